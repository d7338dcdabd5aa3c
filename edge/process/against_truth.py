"""What `mapforest process` made, or any trajectory, against what is true."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from edge.errors import FormatError
from edge.process.products_stage import ProductFacts
from pipeline.evaluation.trajectory import Alignment, Array, Trajectory, TrajectoryErrors, read_tum, trajectory_errors
from pipeline.gnss.geodesy import Datum
from pipeline.products.covariance import read_covariance

ALIGNMENTS: tuple[Alignment, ...] = ("none", "yaw", "se3")


class Compared(msgspec.Struct, frozen=True):
    """One trajectory against the truth."""

    trajectory: str
    errors: TrajectoryErrors


def compare(target: Path, truth: Path, over_m: float = 100.0) -> list[Compared]:
    """target: a session, its products, or a TUM file. truth: a TUM file in the same time and frame, or the folder that
    the emulated payload wrote. FormatError when they cannot be compared."""
    try:
        if target.is_file():
            return _all(target.name, read_tum(target), _plain_truth(truth), over_m)
        return _products(_products_folder(target), truth, over_m)
    except ValueError as error:
        raise FormatError(f"{target} against {truth}: {error}") from error


def _products(folder: Path, truth: Path, over_m: float) -> list[Compared]:
    facts = msgspec.json.decode((folder / "products.json").read_bytes(), type=ProductFacts)
    true = _plain_truth(truth) if truth.is_file() else _simulated(truth, facts)
    found: list[Compared] = []
    if (folder / "trajectory.tum").exists():
        estimate, covariance = read_tum(folder / "trajectory.tum"), None
        stamps, read = read_covariance(folder / "covariance.csv")
        if len(stamps) == len(estimate.stamps_ns):
            covariance = read
        if truth.is_dir():
            estimate = _rebased(estimate, facts, truth)
        found += _all("map", estimate, true, over_m, covariance=covariance)
    odom = read_tum(folder / "trajectory_odom.tum")
    return [*found, *_all("odom", odom, true, over_m, alignments=ALIGNMENTS[1:])]


def _all(
    name: str,
    estimate: Trajectory,
    true: Trajectory,
    over_m: float,
    *,
    covariance: Array | None = None,
    alignments: tuple[Alignment, ...] = ALIGNMENTS,
) -> list[Compared]:
    return [
        Compared(name, trajectory_errors(estimate, true, kind, covariance=covariance, rpe_over_m=over_m))
        for kind in alignments
    ]


def _plain_truth(path: Path) -> Trajectory:
    if path.is_dir():
        raise FormatError(f"{path}: with a plain trajectory the truth is a TUM file, such as {path / 'poses.tum'}")
    return read_tum(path)


def _simulated(folder: Path, facts: ProductFacts) -> Trajectory:
    """The emulated payload's poses in session time."""
    epoch_ns = int(_json(folder / "epoch.json", "monotonic_ns"))
    if facts.host_offset_ns is None:
        raise FormatError(f"{facts.session} was not recorded by mapforest: its time cannot be put to the simulation's")
    return read_tum(folder / "poses.tum").shifted(epoch_ns + facts.host_offset_ns)


def _rebased(estimate: Trajectory, facts: ProductFacts, truth: Path) -> Trajectory:
    """From the session's datum to the simulated world's."""
    world = _json(truth / "world.json", "datum")
    goal = Datum(world["latitude_deg"], world["longitude_deg"], world["height_m"])
    assert facts.datum is not None
    datum = Datum(*facts.datum)
    positions = np.array([goal.enu(*datum.geodetic(position)) for position in estimate.positions_m])
    return Trajectory(estimate.stamps_ns, positions, estimate.rotations)


def _products_folder(target: Path) -> Path:
    for folder in (target, target / "products"):
        if (folder / "products.json").exists():
            return folder
    raise FormatError(f"{target}: not processed yet; run `mapforest process {target}` first")


def _json(path: Path, key: str) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))[key]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FormatError(f"{path}: not what the emulated payload writes; give the folder of its truth") from error
