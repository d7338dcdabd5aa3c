"""A map against surveyed points on the ground."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from pipeline.evaluation.errors import ControlError
from pipeline.inventory.terrain import Terrain

Doubles = npt.NDArray[np.float64]
REACH_M = 0.5
"""Around a point: its ground. Targets are looked for in twice that."""
ON_GROUND_M = 0.2
"""From the terrain's model."""
LEAST_GROUND, LEAST_TARGET = 8, 5
LARGEST_M = 0.5
"""Across: what reflects over more is no target but a taped tree, or two targets."""
_ROUNDS = 3


class ControlPoint(msgspec.Struct, frozen=True):
    """In the coordinates of the map."""

    name: str
    x: float
    y: float
    z: float


class ControlResidual(msgspec.Struct, frozen=True):
    """Map less survey, metres. up_m: None where the map has no ground there. east_m, north_m: of a retro-reflective
    target, along the map's axes; None where none was seen."""

    name: str
    up_m: float | None
    east_m: float | None
    north_m: float | None
    points: int
    """Of the ground around."""


class ControlErrors(msgspec.Struct, frozen=True):
    """Of all points. NaN where there are none."""

    points: tuple[ControlResidual, ...]
    up_rmse_m: float
    up_bias_m: float
    horizontal_rmse_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """Of a control point: xyz (n, 3) from the map's origin, which of them reflect, and the terrain's model."""

    xyz: Doubles
    reflector: npt.NDArray[np.bool_]
    terrain: Terrain


def read_control(path: Path) -> list[ControlPoint]:
    """A CSV with the columns name, x, y, z. ControlError names the line."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.DictReader(file)
            if missing := {"name", "x", "y", "z"} - set(rows.fieldnames or ()):
                raise ControlError(
                    f"{path}: the first line has no {', '.join(sorted(missing))}; it has to name x, y, z"
                )
            found = [_point(path, rows.line_num, row) for row in rows]
    except (OSError, UnicodeDecodeError) as error:
        raise ControlError(f"{path}: cannot be read ({error}); give a CSV with name,x,y,z") from error
    if not found:
        raise ControlError(f"{path}: has no points")
    return found


def _point(path: Path, line: int, row: dict[str, str]) -> ControlPoint:
    try:
        place = [float(row[axis]) for axis in "xyz"]
    except (TypeError, ValueError):
        raise ControlError(f"{path}, line {line}: x, y and z are no numbers") from None
    if not np.isfinite(place).all():
        raise ControlError(f"{path}, line {line}: x, y and z have to be finite")
    return ControlPoint(row["name"], *place)


def residual(point: ControlPoint, at: Doubles, near: Surroundings) -> ControlResidual:
    """at: (3,) the point from the map's origin."""
    away = np.hypot(*(near.xyz[:, :2] - at[:2]).T)
    over = near.xyz[:, 2] - near.terrain.at(near.xyz[:, :2]) if len(near.xyz) else np.empty(0)
    ground = (np.abs(over) < ON_GROUND_M) & (away < REACH_M)
    up = _plane_at(near.xyz[ground], at[:2])
    target = _target(near.xyz[near.reflector & (away < 2.0 * REACH_M)])
    east, north = (None, None) if target is None else (float(target[0] - at[0]), float(target[1] - at[1]))
    return ControlResidual(
        point.name, None if up is None else float(up - at[2]), east, north, int(np.count_nonzero(ground))
    )


def control_errors(residuals: Sequence[ControlResidual]) -> ControlErrors:
    """Together."""
    up = np.array([one.up_m for one in residuals if one.up_m is not None])
    plan = [(one.east_m, one.north_m) for one in residuals if one.east_m is not None and one.north_m is not None]
    return ControlErrors(
        tuple(residuals),
        float(np.sqrt(np.mean(up**2))) if len(up) else float("nan"),
        float(np.mean(up)) if len(up) else float("nan"),
        float(np.sqrt(np.mean(np.sum(np.square(plan), axis=1)))) if plan else float("nan"),
    )


def _plane_at(xyz: Doubles, xy: Doubles) -> float | None:
    """Height of the plane of ground points (n, 3) at (2,), low plants left out round by round."""
    for _ in range(_ROUNDS):
        if len(xyz) < LEAST_GROUND:
            return None
        design = np.column_stack([np.ones(len(xyz)), xyz[:, :2] - xy])
        plane, *_ = np.linalg.lstsq(design, xyz[:, 2], rcond=None)
        off = xyz[:, 2] - design @ plane
        spread = max(1.4826 * float(np.median(np.abs(off - np.median(off)))), 0.005)
        xyz = xyz[np.abs(off - np.median(off)) < 3.0 * spread]
    return float(plane[0])


def _target(xyz: Doubles) -> Doubles | None:
    """(2,) the middle of a retro-reflective target: of its extent, since its near side has more points."""
    if len(xyz) < LEAST_TARGET:
        return None
    low, high = np.percentile(xyz[:, :2], [5.0, 95.0], axis=0)
    return None if (high - low).max() > LARGEST_M else 0.5 * (low + high)
