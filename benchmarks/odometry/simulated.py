"""Simulated walks as the odometry sees them: whole scans and inertial samples with exact times, kept on disk.

A walk is cast once and read back as memory maps, so that every system gets the same bytes.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from drivers.messages import ImuSample, LidarScan
from drivers.sim.imu import GRAVITY_M_S2
from drivers.sim.lidar import LEVER_M
from drivers.sim.scenarios import WorldConfig
from drivers.sim.trajectory import SPLINE_NS, Trajectory
from drivers.sim.world import World, build

EPOCH_NS = 1_000_000_000_000
"""Host time of walk time zero. Some peers read a stamp of zero as no stamp."""
SCAN_NS = 100_000_000
SLOT_NS = 5_000
IMU_NS = 5_000_000
LIDAR_IN_BASE_M = LEVER_M
Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Walk:
    """Where a cast walk lies. points.raw: `POINT` (n,); ends.npy (scans,); imu.npy (m, 12); truth.npy (k, 10).

    first_s: its sweeps of so many seconds alone, None for all.
    """

    folder: Path
    first_s: int | None = None

    @property
    def scan_count(self) -> int:
        """How many sweeps."""
        return len(self._ends())

    @property
    def part(self) -> str:
        """For the names of files that are of these sweeps only."""
        return "" if self.first_s is None else f"_{self.first_s}s"

    def _ends(self) -> npt.NDArray[np.int64]:
        ends: npt.NDArray[np.int64] = np.load(self.folder / "ends.npy")
        return ends if self.first_s is None else ends[: self.first_s * 1_000_000_000 // SCAN_NS]

    def scans(self) -> Iterator[LidarScan]:
        """The sweeps in order."""
        counts = np.diff(self._ends(), prepend=0)
        with (self.folder / "points.raw").open("rb") as file:
            for k, count in enumerate(counts.tolist()):
                part = np.fromfile(file, POINT, count)
                stamp = EPOCH_NS + k * SCAN_NS
                yield LidarScan(
                    stamp,
                    stamp + SCAN_NS,
                    part["xyz_mm"].astype(np.float32) * np.float32(1e-3),
                    np.ascontiguousarray(part["reflectivity"]),
                    np.ascontiguousarray(part["tag"]),
                    (part["slot"] % 4).astype(np.uint8),
                    part["slot"].astype(np.uint32) * np.uint32(SLOT_NS),
                )

    def imu(self) -> list[ImuSample]:
        """The inertial samples in order, in SI units."""
        samples = []
        for k, row in enumerate(np.load(self.folder / "imu.npy").tolist()):
            stamp = EPOCH_NS + k * IMU_NS
            samples.append(ImuSample(stamp, stamp, (row[0], row[1], row[2]), (row[3], row[4], row[5])))
        return samples

    def truth(self) -> tuple[npt.NDArray[np.int64], Doubles, Doubles, Doubles]:
        """Stamps (k,) at 200 Hz; true position (k, 3), quaternion x y z w (k, 4), velocity (k, 3) of `base_link`."""
        rows = np.load(self.folder / "truth.npy")
        return EPOCH_NS + np.arange(len(rows), dtype=np.int64) * IMU_NS, rows[:, :3], rows[:, 3:7], rows[:, 7:]


POINT = np.dtype([("xyz_mm", "<i4", 3), ("slot", "<u2"), ("reflectivity", "u1"), ("tag", "u1")])


@dataclass(frozen=True, slots=True)
class Turn:
    """Of the payload about the vertical, on top of what the carrier does; smooth at both ends."""

    begin_s: float
    took_s: float
    degrees: float


def walk(config: WorldConfig, cache: Path, longest_s: float = 1e9, turns: tuple[Turn, ...] = ()) -> Walk:
    """The walk of a configuration, cast now or taken from `cache`."""
    folder = cache / f"{config.name}_{config.seed}_{config.length_m:.0f}m"
    told = {"longest_s": longest_s} | ({"turns": [asdict(turn) for turn in turns]} if turns else {})
    about = json.dumps(asdict(config) | told, sort_keys=True)
    if (folder / "about.json").exists() and (folder / "about.json").read_text() == about:
        return Walk(folder)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    world = build(config)
    world.trajectory = _turned(world.trajectory, turns)
    end_ns = min(world.trajectory.duration_ns, int(longest_s * 1e9))
    _cast(world, folder, end_ns // SCAN_NS)
    _sense(world, folder, end_ns)
    (folder / "about.json").write_text(about)
    return Walk(folder)


def shortened(config: WorldConfig, length_m: float | None) -> WorldConfig:
    """The same world with a shorter way, for quick looks."""
    return config if length_m is None else replace(config, length_m=length_m)


def _turned(trajectory: Trajectory, turns: tuple[Turn, ...]) -> Trajectory:
    """The same way with other headings."""
    if not turns:
        return trajectory
    times = np.arange(0, trajectory.duration_ns + 1, SPLINE_NS)
    control = trajectory.spline(times)[:, 0].copy()
    for turn in turns:
        share = np.clip((times * 1e-9 - turn.begin_s) / turn.took_s, 0.0, 1.0)
        control[:, 5] += np.radians(turn.degrees) * (share - np.sin(2.0 * np.pi * share) / (2.0 * np.pi))
    return Trajectory(control)


def _cast(world: World, folder: Path, count: int) -> None:
    slots = SCAN_NS // SLOT_NS
    ends, total = [], 0
    with (folder / "points.raw").open("wb") as file:
        for k in range(count):
            block = world.lidar.cast(k * SCAN_NS, slots)
            hit = np.flatnonzero(np.any(block.xyz_mm != 0, axis=1))
            points = np.empty(len(hit), POINT)
            points["xyz_mm"], points["slot"] = block.xyz_mm[hit], hit
            points["reflectivity"], points["tag"] = block.reflectivity[hit], block.tag[hit]
            file.write(points.tobytes())
            total += len(hit)
            ends.append(total)
    np.save(folder / "ends.npy", np.array(ends, np.int64))


def _sense(world: World, folder: Path, end_ns: int) -> None:
    times = np.arange(0, end_ns + IMU_NS, IMU_NS)
    rows = np.empty((len(times), 12))
    for k, t in enumerate(times.tolist()):
        turn, force = world.imu.sample(t)
        bias = world.imu.bias()
        rows[k] = [*turn, *(GRAVITY_M_S2 * f for f in force), *bias[:3], *(GRAVITY_M_S2 * bias[3:])]
    np.save(folder / "imu.npy", rows)
    motion = world.trajectory.at(times)
    np.save(
        folder / "truth.npy",
        np.column_stack([motion.position_m, world.trajectory.quaternions(times), motion.velocity_m_s]),
    )
