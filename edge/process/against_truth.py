"""What `mapforest process` made, what the live pipeline recorded, or any trajectory, against what is true."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from edge.config import Config
from edge.errors import FormatError
from edge.process.product_facts import PRODUCTS_JSON, ProductFacts, read_facts
from edge.replay.poses import LivePoses, read_live_poses
from pipeline.evaluation.pair import ALIGNMENTS, Pair
from pipeline.evaluation.trajectory import Alignment, Trajectory, read_tum, together
from pipeline.gnss.geodesy import Datum
from pipeline.products.covariance import read_covariance

IN_ODOM: tuple[Alignment, ...] = ("yaw", "se3")
"""`odom` begins anywhere: as it is, it says nothing."""
APART = "live - offline"
"""The name of the pair that sets the live `map` against the offline one."""


def find_pairs(target: Path, truth: Path, config: Config | None = None) -> list[Pair]:
    """target: a session, its products, or a TUM file. truth: a TUM file in the same time and frame, or the folder that
    the emulated payload wrote. FormatError when they cannot be compared.

    A session is compared offline, and live where a live pipeline ran; its `map` is put to the truth's by both datums.
    """
    try:
        if target.is_file():
            return [_pair(target.name, read_tum(target), _plain_truth(truth))]
        return list(_of_session(target, truth, config or Config()))
    except ValueError as error:
        raise FormatError(f"{target} against {truth}: {error}") from error


def _of_session(target: Path, truth: Path, config: Config) -> Iterator[Pair]:
    folder = products_folder(target)
    facts = read_facts(folder)
    true = _plain_truth(truth) if truth.is_file() else simulated_way(truth, facts)
    here = Datum(*facts.datum) if facts.datum is not None else None
    goal = here if truth.is_file() else world_datum(truth)
    offline = _offline(folder)
    if offline is not None and here is not None and goal is not None:
        offline = _in_map(offline.moved(here.turn, here.origin_m), goal)
    if offline is not None:
        yield _pair("map", offline, true)
    if (folder / "trajectory_local.tum").exists():
        yield _pair("local", read_tum(folder / "trajectory_local.tum"), true, IN_ODOM)
    yield _pair("odom", read_tum(folder / "trajectory_odom.tum"), true, IN_ODOM)
    if any(target.glob("*.mcap")):
        yield from _live(read_live_poses(target, config), goal, true, offline)


def _live(live: LivePoses, goal: Datum | None, true: Trajectory, offline: Trajectory | None) -> Iterator[Pair]:
    in_map = _in_map(live.earth, goal) if live.earth is not None and goal is not None else None
    if in_map is not None and in_map.overlaps(true):
        yield _pair("live map", in_map, true)
    if live.odom is not None and live.odom.overlaps(true):
        yield _pair("live odom", live.odom, true, IN_ODOM)
    if in_map is not None and offline is not None and in_map.overlaps(offline):
        yield Pair(APART, *together(in_map, offline), ("none",), against="offline trajectory")


def _pair(name: str, estimate: Trajectory, true: Trajectory, alignments: tuple[Alignment, ...] = ALIGNMENTS) -> Pair:
    return Pair(name, estimate.within(true), true, alignments)


def _offline(products: Path) -> Trajectory | None:
    """In `map`; None for a session that could not be placed."""
    if not (products / "trajectory.tum").exists():
        return None
    found = read_tum(products / "trajectory.tum")
    poses = read_covariance(products / "covariance.csv")
    return replace(found, covariance=poses.covariance[:, :3, :3]) if len(poses) == len(found.stamps_ns) else found


def _in_map(earth: Trajectory, datum: Datum) -> Trajectory:
    """From Earth-centred axes."""
    return earth.moved(datum.turn.T, -datum.turn.T @ datum.origin_m)


def _plain_truth(path: Path) -> Trajectory:
    if not path.is_file():
        raise FormatError(f"{path}: with a plain trajectory the truth is a TUM file, such as poses.tum of a simulation")
    return read_tum(path)


def simulated_way(folder: Path, facts: ProductFacts) -> Trajectory:
    """The emulated payload's poses in session time."""
    return read_tum(folder / "poses.tum").shifted(walk_begins_ns(folder, facts))


def walk_begins_ns(folder: Path, facts: ProductFacts) -> int:
    """Session time of the emulated walk's t = 0."""
    epoch_ns = int(_json(folder / "epoch.json", "monotonic_ns"))
    if facts.host_offset_ns is None:
        raise FormatError(f"{facts.session} was not recorded by mapforest: its time cannot be put to the simulation's")
    return epoch_ns + facts.host_offset_ns


def world_datum(truth: Path) -> Datum:
    """Where the simulated world lies."""
    world = _json(truth / "world.json", "datum")
    return Datum(world["latitude_deg"], world["longitude_deg"], world["height_m"])


def products_folder(target: Path) -> Path:
    """Of a session, or itself. FormatError where there are none."""
    for folder in (target, target / "products"):
        if (folder / PRODUCTS_JSON).exists():
            return folder
    raise FormatError(f"{target}: not processed yet; run `mapforest process {target}` first")


def _json(path: Path, key: str) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))[key]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FormatError(f"{path}: not what the emulated payload writes; give the folder of its truth") from error
