"""`python -m benchmarks.alignment`: success, errors and time, ours, the published method, and peers."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.alignment import poses, stand_trials
from benchmarks.alignment.peer_trials import clique, peers
from benchmarks.alignment.trials import OURS, Trial, log, ours, push_cloud, push_stems, pushes, table
from pipeline.alignment.cloud import inspect
from pipeline.alignment.stem_table import read_stems


def main() -> None:
    """Each prints a table in Markdown."""
    parser = argparse.ArgumentParser(prog="benchmarks.alignment", description=__doc__)
    parser.add_argument("what", choices=["chablais", "fort-valley", "stands", "poses"])
    parser.add_argument("--data", type=Path, default=Path("../shared/data/forest"))
    parser.add_argument("--count", type=int, default=100, help="perturbations, or seeds")
    parser.add_argument("--methods", nargs="*", default=list(OURS), help="of ours; 'clique' as well")
    parser.add_argument("--peers", type=Path, help="a Python with open3d and small_gicp")
    parser.add_argument("--torch", type=Path, help="a Python with torch")
    parser.add_argument("--log", type=Path, default=Path(tempfile.gettempdir()) / "alignment.jsonl")
    args = parser.parse_args()
    if args.what == "poses":
        print(poses.compare(args.torch))
        return
    if args.what == "stands":
        print(stand_trials.run(args.count))
        return
    run = _chablais if args.what == "chablais" else _fort_valley
    with tempfile.TemporaryDirectory() as folder:
        found = []
        for one in run(args, Path(folder)):
            log(args.log, args.what, one)
            found.append(one)
    print(table(found))


def _chablais(args: argparse.Namespace, folder: Path) -> Iterator[Trial]:
    aerial, stems = args.data / "chablais3_als.laz", args.data / "chablais3_trees.csv"
    places = read_stems(stems).places_m
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    for true in pushes(middle, args.count):
        ground = push_stems(stems, folder / "stems.csv", true)
        for method in args.methods:
            yield clique(aerial, ground, true) if method == "clique" else ours(method, aerial, ground, true)
    if args.peers:
        yield from peers(args.peers, aerial, stems, pushes(middle, args.count), folder)


def _fort_valley(args: argparse.Namespace, folder: Path) -> Iterator[Trial]:
    aerial, ground = args.data / "fort_valley_als.laz", args.data / "fort_valley_mls.laz"
    cloud = inspect(ground)
    middle = np.asarray((cloud.low_m + cloud.high_m)[:2] / 2)
    for true in pushes(middle, args.count):
        pushed = push_cloud(ground, folder / "ground.laz", true)
        for method in args.methods:
            # Both clips have one outline: a turn alone takes the corners off it.
            yield ours(method, aerial, pushed, true, overlap=0.7)
    if args.peers:
        yield from peers(args.peers, aerial, ground, pushes(middle, args.count), folder)


if __name__ == "__main__":
    main()
