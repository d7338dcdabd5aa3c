"""The whole onboard pipeline over simulated walks: is the map right, and what does it cost.

    python -m benchmarks.pipeline --cache DIR [--scenario demo] [--seeds 1 2 3 4 5] [--detect MODEL]

Each walk is recorded with all that the payload records (camera at 29.97 Hz, rendered once and kept in DIR, half a
minute of work for ten seconds of walk), processed anew in a process of its own, and its trees are compared with those
of the simulated forest. First table: trees, on the Earth and with the trajectory's error taken off. Second: seconds of
each stage as a share of the recording's, times as fast as it was recorded, memory at most.
"""

from __future__ import annotations

import argparse
import heapq
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from benchmarks.fusion.table import received
from benchmarks.odometry.simulated import EPOCH_NS, walk
from benchmarks.recorded import Message, write_recording
from benchmarks.watched import Run, process
from drivers.messages import VideoFrame
from drivers.sim.camera import PREVIEW_LATENCY_S, Camera, exposure_ns
from drivers.sim.renderer import Renderer
from drivers.sim.scenarios import scenario
from drivers.sim.truth import write_epoch, write_truth
from drivers.sim.video import RenderedVideo
from drivers.sim.world import World, build
from edge.config import load
from edge.process.process import STAGES
from edge.process.trees_against_truth import compare_trees
from pipeline.evaluation.trees import TreeErrors

TREES = "{:<14}{:<16}{:>9}{:>8}{:>9}{:>10}{:>10}{:>9}{:>8}"
LEFT_NS = 5_000_000
"""Of the camera's latency, what its calibration did not find."""


def main() -> None:
    options = _options()
    probable = load(None).grounding.probable
    runs = []
    print(TREES.format("walk", "trees", "found", "recall", "right", "precision", "median m", "worst m", "in 95%"))
    for seed in options.seeds:
        name = f"{options.scenario}_{seed}"
        source, truth = _recording(options.cache, options.scenario, seed)
        output = options.cache / f"{name}_products"
        run = process(source, output, ["--detect", options.detect], 0.2)
        runs.append((name, run))
        found = compare_trees(output, truth, probable)
        if found.on_the_earth is not None:
            _row(name, "on the Earth", found.on_the_earth)
        _row(name, "beside the way", found.beside_the_way)
    print("\n" + "{:<14}{:>6}".format("walk", "s") + "".join(f"{stage:>18}" for stage in STAGES) + f"{'times':>7}")
    for name, run in runs:
        _costs(name, run)


def _row(name: str, what: str, e: TreeErrors) -> None:
    found, right = f"{e.found} of {e.true}", f"{e.right} of {e.mapped}"
    shares = (f"{e.recall:.2f}", right, f"{e.precision:.2f}")
    places = (f"{e.error_median_m:.2f}", f"{e.error_worst_m:.2f}", f"{e.within_95:.0%}")
    print(TREES.format(name, what, found, *shares, *places), flush=True)


def _costs(name: str, run: Run) -> None:
    length_s = run.facts["duration_s"]
    told = (f"{run.seconds(k) / length_s:.1%}, {run.most_mb(k):.0f} MB" for k in range(len(STAGES)))
    print(f"{name:<14}{length_s:>6.0f}" + "".join(f"{one:>18}" for one in told) + f"{length_s / run.took_s:>7.1f}")


def _recording(cache: Path, name: str, seed: int) -> tuple[Path, Path]:
    """The .mcap, and the folder of what is true."""
    config = scenario(name, seed)
    path, truth = cache / f"{name}_{seed}.mcap", cache / f"{name}_{seed}_truth"
    if not path.exists():
        world = build(config)
        write_truth(world, truth)
        write_epoch(truth, EPOCH_NS)
        write_recording(path, _messages(world, cache))
    return path, truth


def _messages(world: World, cache: Path) -> Iterator[Message]:
    """In the order of arrival."""
    cast = walk(world.config, cache)
    fixes = (
        replace(fix, stamp_ns=fix.stamp_ns + EPOCH_NS, receive_ns=fix.receive_ns + EPOCH_NS)
        for fix in received(world, "honest", world.config.seed + 10)
    )
    return heapq.merge(cast.imu(), cast.scans(), fixes, _video(world), key=lambda message: message.receive_ns)


def _video(world: World) -> Iterator[VideoFrame]:
    camera = Camera()
    renderer = Renderer(world.scene, world.trajectory, camera, world.config.seed)
    video = RenderedVideo(renderer, camera.width_px, camera.height_px)
    frame = 0
    while (exposed_ns := exposure_ns(frame)) <= world.trajectory.duration_ns:
        unit, key = video.access_unit(frame)
        came_ns = EPOCH_NS + exposed_ns + int(1e9 * PREVIEW_LATENCY_S)
        yield VideoFrame(EPOCH_NS + exposed_ns + LEFT_NS, came_ns, unit, key, exposed_ns * 9 // 100_000)
        frame += 1


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where recordings and products are kept")
    parser.add_argument("--scenario", default="demo")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5], help="1 to 20: no model learned there")
    parser.add_argument("--detect", default="demo", metavar="MODEL")
    return parser.parse_args()


if __name__ == "__main__":
    main()
