"""How far an estimated trajectory is from the true one: APE, RPE, drift, and whether the covariance is honest.

Terms as in `evo` and Zhang and Scaramuzza (2018). Errors are of positions, metres, unless named otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation, Slerp

Array = npt.NDArray[np.float64]
Alignment = Literal["none", "yaw", "se3"]
CHI2_3_95 = 7.815
FEWEST = 3


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """stamps_ns: (n,) int64, rising. positions_m: (n, 3). rotations: (n, 3, 3).

    covariance: (n, 3, 3) of the positions, None where nobody states one.
    """

    stamps_ns: npt.NDArray[np.int64]
    positions_m: Array
    rotations: Array
    covariance: Array | None = None

    def shifted(self, by_ns: int) -> Trajectory:
        """In another clock."""
        return replace(self, stamps_ns=self.stamps_ns + by_ns)

    def moved(self, turn: Array, by_m: Array) -> Trajectory:
        """In another frame, where this one's axes are turned (3, 3) and its origin is at `by_m` (3,)."""
        positions = np.asarray(self.positions_m @ turn.T + by_m)
        covariance = None if self.covariance is None else np.asarray(turn @ self.covariance @ turn.T)
        return Trajectory(self.stamps_ns, positions, turn @ self.rotations, covariance)

    def chosen(self, which: npt.NDArray[np.bool_]) -> Trajectory:
        """Some of its poses."""
        covariance = None if self.covariance is None else self.covariance[which]
        return Trajectory(self.stamps_ns[which], self.positions_m[which], self.rotations[which], covariance)

    def overlaps(self, other: Trajectory) -> bool:
        """Whether enough poses lie between the first and the last of another."""
        return int(self._inside(other).sum()) >= FEWEST

    def within(self, other: Trajectory) -> Trajectory:
        """Those poses. ValueError when there are too few."""
        if not self.overlaps(other):
            raise ValueError("the trajectories do not overlap in time")
        return self.chosen(self._inside(other))

    def _inside(self, other: Trajectory) -> npt.NDArray[np.bool_]:
        return np.asarray((self.stamps_ns >= other.stamps_ns[0]) & (self.stamps_ns <= other.stamps_ns[-1]))

    def at(self, stamps_ns: npt.NDArray[np.int64]) -> Trajectory:
        """Between its poses; the stamps lie within it."""
        origin = self.stamps_ns[0]
        times, wanted = (self.stamps_ns - origin) / 1e9, (stamps_ns - origin) / 1e9
        rotations = Slerp(times, Rotation.from_matrix(self.rotations))(wanted).as_matrix()
        covariance = None
        if self.covariance is not None:
            covariance = _between(times, self.covariance.reshape(-1, 9), wanted).reshape(-1, 3, 3)
        return Trajectory(stamps_ns, _between(times, self.positions_m, wanted), rotations, covariance)


class Spread(msgspec.Struct, frozen=True):
    """Of an error over a trajectory."""

    rmse: float
    mean: float
    median: float
    worst: float


class TrajectoryErrors(msgspec.Struct, frozen=True):
    """alignment: what was done to the estimate before. NaN in what the trajectory is too short for."""

    alignment: str
    poses: int
    length_m: float
    """Of the true way."""
    ape_m: Spread
    ape_horizontal_m: Spread
    ape_vertical_m: Spread
    ape_deg: Spread
    rpe_m: Spread
    """Over stretches of `rpe_over_m` of the true way."""
    rpe_deg: Spread
    rpe_over_m: float
    end_m: float
    drift_percent: float
    """Error at the end with the starts laid together, of the length."""
    nees: float = float("nan")
    """Mean normalised squared error of position: 1 is honest, above is overconfident. Without alignment only."""
    within_95: float = float("nan")
    """Share of positions within the 95 % ellipsoid."""


def read_tum(path: Path) -> Trajectory:
    """`t x y z qx qy qz qw` a line. ValueError for what is none."""
    rows = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]
    if not rows or any(len(row) != 8 for row in rows):
        raise ValueError(f"{path}: not a trajectory in the TUM format (eight numbers a line)")
    values = np.array([row[1:] for row in rows], dtype=np.float64)
    stamps = np.array([_nanoseconds(row[0]) for row in rows], dtype=np.int64)
    kept = np.concatenate([[True], np.diff(stamps) > 0])
    return Trajectory(stamps[kept], values[kept, :3], Rotation.from_quat(values[kept, 3:]).as_matrix())


def trajectory_errors(
    estimate: Trajectory,
    truth: Trajectory,
    alignment: Alignment = "none",
    *,
    rpe_over_m: float = 100.0,
) -> TrajectoryErrors:
    """Both in one clock. ValueError without an overlap."""
    estimate = estimate.within(truth)
    true = truth.at(estimate.stamps_ns)
    moved = aligned(estimate, true, alignment)
    away = moved.positions_m - true.positions_m
    way = travelled_m(true)
    along, turned = relative_errors(moved, true, way, rpe_over_m)
    end_m = float(np.linalg.norm(_from_start(moved)[-1] - _from_start(true)[-1]))
    squared = np.full(1, np.nan)
    if estimate.covariance is not None and alignment == "none":
        squared = normalised_square(away, estimate.covariance)
    return TrajectoryErrors(
        alignment=alignment,
        poses=len(away),
        length_m=float(way[-1]),
        ape_m=spread(np.linalg.norm(away, axis=1)),
        ape_horizontal_m=spread(np.linalg.norm(away[:, :2], axis=1)),
        ape_vertical_m=spread(np.abs(away[:, 2])),
        ape_deg=spread(_angles_deg(moved.rotations, true.rotations)),
        rpe_m=spread(along),
        rpe_deg=spread(turned),
        rpe_over_m=rpe_over_m,
        end_m=end_m,
        drift_percent=100.0 * end_m / float(way[-1]) if way[-1] > 0 else float("nan"),
        nees=float(squared.mean() / 3.0),
        within_95=float((squared < CHI2_3_95).mean()) if np.isfinite(squared).all() else float("nan"),
    )


def aligned(estimate: Trajectory, true: Trajectory, alignment: Alignment) -> Trajectory:
    """The estimate laid over the truth with the least squares of positions (Umeyama 1991, without scale)."""
    if alignment == "none":
        return estimate
    middle, goal = estimate.positions_m.mean(axis=0), true.positions_m.mean(axis=0)
    cross = (true.positions_m - goal).T @ (estimate.positions_m - middle)
    turn = _yaw(cross) if alignment == "yaw" else _turn(cross)
    return estimate.moved(turn, goal - turn @ middle)


def together(one: Trajectory, other: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Two estimates of one way at the stamps of the first, the covariance of their difference with the first.

    The sum of both, as if their errors were independent: what they share makes the difference smaller than that says.
    """
    one = one.within(other)
    other = other.at(one.stamps_ns)
    if one.covariance is None or other.covariance is None:
        return one, other
    return replace(one, covariance=one.covariance + other.covariance), other


def travelled_m(one: Trajectory) -> Array:
    """(n,) length of the way up to each pose."""
    steps = np.linalg.norm(np.diff(one.positions_m, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def relative_errors(estimate: Trajectory, true: Trajectory, way_m: Array, over_m: float) -> tuple[Array, Array]:
    """(k,) metres and (k,) degrees over stretches of `over_m`, from every pose with so much before it."""
    ends = np.searchsorted(way_m, way_m + over_m)
    starts = np.flatnonzero(ends < len(way_m))
    ends = ends[starts]
    steps = []
    for one in (estimate, true):
        back = one.rotations[starts].transpose(0, 2, 1)
        steps.append(
            (
                np.einsum("nij,nj->ni", back, one.positions_m[ends] - one.positions_m[starts]),
                back @ one.rotations[ends],
            )
        )
    (moved, turned), (moved_true, turned_true) = steps
    # Of the relative pose error Q^-1 P the translation has the length of this difference.
    return np.linalg.norm(moved - moved_true, axis=1), _angles_deg(turned, turned_true)


def normalised_square(away: Array, covariance: Array) -> Array:
    """(n,) squared Mahalanobis distances of errors (n, 3): chi-square with three degrees of freedom when honest."""
    return np.asarray(np.einsum("ni,ni->n", away, np.linalg.solve(covariance, away[..., None])[..., 0]))


def _between(times: Array, values: Array, wanted: Array) -> Array:
    return np.column_stack([np.interp(wanted, times, column) for column in values.T])


def _from_start(one: Trajectory) -> Array:
    """Positions as seen from the first pose."""
    return np.asarray((one.positions_m - one.positions_m[0]) @ one.rotations[0])


def _yaw(cross: Array) -> Array:
    angle = float(np.arctan2(cross[1, 0] - cross[0, 1], cross[0, 0] + cross[1, 1]))
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], np.float64)


def _turn(cross: Array) -> Array:
    u, _, v = np.linalg.svd(cross)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v)


def _angles_deg(one: Array, other: Array) -> Array:
    if not len(one):
        return np.empty(0)
    turns = Rotation.from_matrix(one.transpose(0, 2, 1) @ other).magnitude()
    return np.degrees(np.asarray(turns, np.float64))


def spread(errors: Array) -> Spread:
    """Of errors (n,), NaN of none."""
    if not len(errors):
        return Spread(*[float("nan")] * 4)
    return Spread(
        float(np.sqrt(np.mean(errors**2))), float(errors.mean()), float(np.median(errors)), float(errors.max())
    )


def _nanoseconds(text: str) -> int:
    """Exactly, where the text has the digits: a double has none left for nanoseconds."""
    whole, _, rest = text.partition(".")
    if not rest or not (whole.lstrip("-").isdecimal() and rest.isdecimal()):
        return round(float(text) * 1e9)
    sign = -1 if whole.startswith("-") else 1
    return int(whole) * 1_000_000_000 + sign * int(rest[:9].ljust(9, "0"))
