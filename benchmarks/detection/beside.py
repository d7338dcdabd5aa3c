"""What the live detector costs the odometry beside it: sweeps with and without it, in turn.

    python -m benchmarks.detection.beside SESSION MODEL.onnx [--turns 12] [--sweeps 25]

The odometry works through the session as fast as it can; for every second turn the detector looks at the session's
images in its own thread, as in `mapforest pipeline`. Prints milliseconds a sweep on the wall and of the processor,
medians over all sweeps of a kind.
"""

from __future__ import annotations

import argparse
import itertools
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from edge.bus.envelope import Envelope
from edge.config import Config, Detection
from edge.live.detection import LiveDetection
from edge.process.estimators import estimators, odometry_config
from edge.replay.pairing import Pairing, Sweep
from edge.replay.replay import Replay
from edge.replay.store import MessageStore

CAMERA_HZ = 30.0


class Camera:
    """A bus with the session's video, again and again, in real time; empty while it is off."""

    def __init__(self, store: MessageStore, topic: str) -> None:
        self.on = threading.Event()
        self.sent = 0
        units = [bytes(raw.data) for raw in store.messages({topic})]
        self._units = itertools.cycle(enumerate(units))
        self._topic = topic
        self._next_s = 0.0

    def __enter__(self) -> Camera:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def receive(self, timeout_s: float) -> Iterator[Envelope]:
        if timeout_s and (not self.on.wait(timeout_s) or time.monotonic() < self._next_s):
            time.sleep(0.01)
        now_s = time.monotonic()
        self._next_s = max(self._next_s, now_s - 2.0)
        while self.on.is_set() and self._next_s <= now_s:
            number, data = next(self._units)
            yield Envelope(self._topic, number, 0, 0, data)
            self._next_s += 1.0 / CAMERA_HZ

    def send(self, _result: object) -> None:
        self.sent += 1


def main() -> None:
    options = _options()
    config = Config(detection=Detection(model=str(options.model)))
    replay = Replay([options.session], config)
    odometry = estimators().odometry(odometry_config(config, replay.geometry))
    camera, stop = Camera(MessageStore([options.session]), config.topics.video), threading.Event()
    live = LiveDetection(config, lambda _topics: camera)
    live.start(stop)
    while live.state.state == "starting":
        time.sleep(0.1)
    times: dict[bool, list[tuple[float, float]]] = {False: [], True: []}
    sweeps = _sweeps(replay)
    for sweep in itertools.islice(sweeps, options.sweeps):
        list(odometry.process(sweep))
    for turn in range(options.turns):
        beside = turn % 2 == 1
        (camera.on.set if beside else camera.on.clear)()
        time.sleep(0.3)
        for sweep in itertools.islice(sweeps, options.sweeps):
            wall_s, own_s = time.perf_counter(), time.thread_time()
            list(odometry.process(sweep))
            times[beside].append((time.perf_counter() - wall_s, time.thread_time() - own_s))
    stop.set()
    live.join()
    print("| odometry | sweeps | ms on the wall | of the processor |\n|---|---|---|---|")
    for beside, name in ((False, "alone"), (True, f"beside the detector ({camera.sent} images)")):
        wall, own = 1e3 * np.median(np.array(times[beside]), axis=0)
        print(f"| {name} | {len(times[beside])} | {wall:.1f} | {own:.1f} |")


def _sweeps(replay: Replay) -> Iterator[Sweep]:
    pairing = Pairing()
    for message in replay.messages(gnss=False):
        yield from pairing.add(message)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.detection.beside", description=__doc__)
    parser.add_argument("session", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--turns", type=int, default=12)
    parser.add_argument("--sweeps", type=int, default=25)
    return parser.parse_args()


if __name__ == "__main__":
    main()
