"""People taken out of the map, of whom every point is known; prints a table in Markdown.

    python -m benchmarks.refinement.moving --cache DIR [--cases none companions walkers]

25 s of the walk of `benchmarks.odometry.faults`, with the people of its catalogue and without. A point is of a person
where the same scan without them has it elsewhere: the lowest bit of its reflectivity tells. The map is what `process`
makes of it: our odometry, tiles and submaps. Of all other points the shares that are lost, below the sensor and above.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.odometry.faults.catalogue import CASES, Case, cast
from benchmarks.odometry.faults.streams import SECOND_NS, Span, Streams
from benchmarks.odometry.simulated import SCAN_NS
from drivers.messages import LidarScan
from edge.config import Products
from edge.process.sweep_odometry import SweepOdometry
from edge.replay.pairing import Sweep
from pipeline.products.tiles import TileStore, read_tile, tiles
from pipeline.products.track import Placement, record_of
from pipeline.refinement.config import MovingConfig
from pipeline.refinement.moving import Seen, moved
from pipeline.refinement.submaps import SubmapWriter, read_submaps

HEIGHTS_M = (-np.inf, -2.0, -0.8, 0.5, np.inf)
"""Above the sensor: below the ground at hand, it and what grows low, persons, crowns."""
SHORT = 40
"""Scans."""
BIT = np.uint8(1)
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """Of each point: whether it is a person's, whether it was taken out, and how high above the sensor it is."""

    person: Mask
    taken: Mask
    height_m: npt.NDArray[np.float64]
    seconds: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where cast walks are kept")
    parser.add_argument("--cases", nargs="+", default=["none", "companions", "walkers"], choices=list(CASES))
    options = parser.parse_args()
    walk = cast(options.cache, turning=False)
    _tried(CASES["none"], replace(walk, scans=walk.scans[:SHORT]))  # compiled kernels are loaded before the clock runs
    bands = [f"{low:g} to {high:g} m" for low, high in pairwise(HEIGHTS_M)]
    columns = ["people", "points", "of people", "taken out", "of all others lost", *bands, "s a million points"]
    print("| " + " | ".join(columns) + " |")
    print("| --- " * len(columns) + "|")
    for name in options.cases:
        print(f"| {CASES[name].name} | {row(_tried(CASES[name], walk))} |", flush=True)


def row(result: Result) -> str:
    """Its figures, as the table has them."""
    count, people, others = len(result.person), int(result.person.sum()), ~result.person
    taken = f"{result.taken[result.person].mean():.1%}" if people else "-"
    lost = [_share(result.taken[others])]
    for low, high in pairwise(HEIGHTS_M):
        lost.append(_share(result.taken[others & (result.height_m >= low) & (result.height_m < high)]))
    return " | ".join([f"{count:,}", f"{people:,}", taken, *lost, f"{1e6 * result.seconds / count:.1f}"])


def _share(taken: Mask) -> str:
    return f"{taken.mean():.2%} ({taken.sum():,})" if len(taken) else "-"


def _tried(case: Case, walk: Streams) -> Result:
    begin_ns = int(walk.truth.stamps_ns[0] + case.begin_s * SECOND_NS)
    peopled = case.fault(walk, Span(begin_ns, begin_ns + int(case.lasts_s * SECOND_NS)))
    scans = [_marked(scan, bare) for scan, bare in zip(peopled.scans, walk.scans, strict=True)]
    with tempfile.TemporaryDirectory() as folder:
        seen, work = _mapped(replace(peopled, scans=tuple(scans)), Path(folder)), Path(folder) / "work"
        work.mkdir()
        begun = time.process_time()
        found = moved(seen, MovingConfig(), work)
        seconds = time.process_time() - begun
        points = np.concatenate([read_tile(seen.tiles, tile, seen.voxel_m) for tile in tiles(seen.tiles)])
    height_m = points["xyz"][:, 2] - seen.track["position_m"][points["sweep"], 2]
    taken = np.concatenate([found[tile] for tile in sorted(found)])
    return Result((points["intensity"] & BIT).astype(np.bool_), taken, height_m, seconds)


def _marked(scan: LidarScan, bare: LidarScan) -> LidarScan:
    person = (scan.xyz_m != bare.xyz_m).any(axis=1)
    return replace(scan, reflectivity=(scan.reflectivity & ~BIT) | person.astype(np.uint8))


def _mapped(streams: Streams, folder: Path) -> Seen:
    """As `process` maps it, without GNSS."""
    products, odometry = Products(), SweepOdometry(CASES["none"].config)
    store = TileStore(folder / "tiles", products.tile_m, products.voxel_m)
    submaps, track, used = SubmapWriter(folder / "submaps"), [], 0
    for scan in streams.scans:
        until = used
        while until < len(streams.imu) and streams.imu[until].stamp_ns <= scan.stamp_ns + SCAN_NS:
            until += 1
        for one in odometry.process(Sweep(scan, streams.imu[used:until])):
            store.add(one.cloud, len(track))
            submaps.add(one.estimate, one.cloud, len(track))
            track.append(record_of(one.estimate))
        used = until
    store.close()
    submaps.close()
    none = np.zeros((len(track), 6, 6))
    placement = Placement.upright(None, none[:, 0, :3], none[:, 0, 0], none)
    return Seen(folder / "tiles", products.voxel_m, np.concatenate(track), placement, read_submaps(folder / "submaps"))


if __name__ == "__main__":
    main()
