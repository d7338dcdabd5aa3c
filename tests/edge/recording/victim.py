"""A recorder to be killed: `python -m tests.edge.recording.victim FOLDER` records at full rate until then.

Session time is host time here, so whoever kills it can tell from the file how much was lost.
"""

import sys
import threading
import time
from pathlib import Path

from edge.recording.account import SessionAbout
from edge.recording.anchor import Anchor
from edge.recording.session import SessionRecorder
from tests.edge.recording.recording_scene import S, limits, second


def main(folder: Path) -> None:
    recorder = SessionRecorder(folder, SessionAbout(), limits(split_s=1.5), Anchor(0, 0))
    recorder.start()
    pause = threading.Event()
    start_ns = time.monotonic_ns()
    sys.stdout.write("recording\n")
    sys.stdout.flush()
    for k in range(60):
        for message in second(start_ns + k * S, points=13_000, video_bytes=10_000):
            pause.wait(max(0, message.receive_ns - time.monotonic_ns()) / 1e9)
            recorder.offer(message)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
