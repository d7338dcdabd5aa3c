"""Camera and LiDAR from a board that both see, at several places and angles (plane to plane).

In each pose the camera knows the board's plane from its corners, and the LiDAR from its points (centre c, axes e1 e2,
spread s1 s2). With the plane n . x = d of the camera the three residuals, all in metres, are
n . (R c + t) - d,   s1 n . R e1,   s2 n . R e2.
Each pose counts by what its corners and points leave open: corners tell the tilt of a board that is far off, or
that faces the camera, several times worse than that of a near and tilted one. The scatter over all poses gives the
uncertainty. Three planes of different directions determine everything.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from pipeline.calibration.board import Board, Sighting
from pipeline.calibration.board_points import Patch, Place, cut_patch, find_patch
from pipeline.calibration.errors import CalibrationError
from pipeline.calibration.extrinsics import Extrinsics, Found
from pipeline.calibration.lens import board_pose
from pipeline.calibration.turning import Array
from pipeline.camera import CameraModel

LEAST_POSES = 5
OUTLIER = 3.5
"""A pose whose residual is so many times the median is left out, if it is above `FINE_M`."""
FINE_M = 0.01
FAR_SIGMAS = 3.0
"""Of a residual, from where on it counts less."""
LEAST_PX, LEAST_M = 0.05, 0.001
"""Corners and the middle of a board's points are not better than that, whatever their scatter says."""
WORST_ROTATION_DEG = 0.5
WORST_TRANSLATION_M = 0.03
WORST_RESIDUAL_M = 0.02
LOOSEST = np.array([np.radians(10.0)] * 3 + [0.3] * 3)
"""Nothing is less sure than that: the guess was better."""
FLOOR = np.array([np.radians(0.05)] * 3 + [0.003] * 3)
"""What scatter over poses does not show: an error of the lens or of the range is the same in all of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Hold:
    """The board held still. points_m: (n, 3), what the LiDAR saw meanwhile, in `livox_frame`."""

    sighting: Sighting
    points_m: Array


@dataclass(frozen=True, slots=True)
class HoldReport:
    """points: of the board. residual_m: RMS of its three. why: it is not used; empty: it is."""

    name: str
    points: int
    residual_m: float
    why: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class BoardFound(Found):
    """residual_m: RMS over the poses that are used."""

    residual_m: float = 0.0
    holds: tuple[HoldReport, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """A hold with the board's pose in the optical frame; None where the camera cannot tell it.

    covariance: (6, 6) of that pose, a turn about the board's origin and a shift, both in the optical frame.
    """

    hold: Hold
    corners_m: Array
    pose: tuple[Array, Array] | None
    covariance: Array

    @classmethod
    def of(cls, hold: Hold, board: Board, camera: CameraModel) -> _Seen:
        pose = board_pose(hold.sighting, camera)
        if pose is None:
            return cls(hold, board.outline_m, None, np.eye(6))
        turned = Rotation.from_rotvec(pose[0]).as_matrix(), pose[1]
        return cls(hold, board.outline_m, turned, _pose_covariance(hold.sighting, camera, turned))

    def look(self, guess: Extrinsics) -> Patch | None:
        place = self._place(guess)
        return None if place is None else find_patch(self.hold.points_m, place)

    def cut(self, found: Extrinsics) -> Patch | None:
        place = self._place(found)
        return None if place is None else cut_patch(self.hold.points_m, place)

    def _place(self, extrinsics: Extrinsics) -> Place | None:
        if self.pose is None:
            return None
        turn, move = self.pose
        back = extrinsics.rotation.T
        return Place(back @ turn, back @ (move - extrinsics.translation_m), self.corners_m)


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """normal, distance_m: of the plane in the optical frame. white: (3, 3) makes residuals of one sigma each."""

    seen: _Seen
    patch: Patch
    white: Array

    @classmethod
    def of(cls, seen: _Seen, patch: Patch, near: Extrinsics) -> _Pair:
        """near: the pose, as far as it is known."""
        assert seen.pose is not None
        normal = seen.pose[0][:, 2]
        arm_m = near.rotation @ patch.centre_m + near.translation_m - seen.pose[1]
        axes = patch.spread_m[:, None] * (patch.axes @ near.rotation.T)
        by_pose = np.zeros((3, 6))
        by_pose[0] = [*np.cross(normal, arm_m), *-normal]
        by_pose[1:, :3] = np.cross(normal, axes)
        of_points = patch.thickness_m**2 / patch.points + LEAST_M**2
        covariance = by_pose @ seen.covariance @ by_pose.T + of_points * np.eye(3)
        return cls(seen, patch, np.linalg.inv(np.linalg.cholesky(covariance)))

    @property
    def name(self) -> str:
        return self.seen.hold.sighting.name

    @property
    def normal(self) -> Array:
        assert self.seen.pose is not None
        return np.asarray(self.seen.pose[0][:, 2])

    @property
    def distance_m(self) -> float:
        assert self.seen.pose is not None
        return float(self.normal @ self.seen.pose[1])


def from_board(holds: Sequence[Hold], board: Board, camera: CameraModel, guess: Extrinsics) -> BoardFound:
    """guess: measured by hand, a few degrees and centimetres off. CalibrationError when hardly a pose can be used."""
    seen = [_Seen.of(hold, board, camera) for hold in holds]
    pairs = [_Pair.of(one, patch, guess) for one in seen if (patch := one.look(guess)) is not None]
    if len(pairs) < LEAST_POSES:
        raise CalibrationError(
            f"the board can be used in {len(pairs)} of {len(holds)} poses, and {LEAST_POSES} are needed: the LiDAR "
            "does not see it in the others. Hold it still for two seconds each, 1 to 3 m away, above the middle of the "
            "picture, tilted differently each time"
        )
    found = _agreed(pairs, guess)[0]
    for _ in range(2):
        # Near enough now to cut the board out.
        pairs = [_Pair.of(pair.seen, pair.seen.cut(found) or pair.patch, found) for pair in pairs]
        found, used = _agreed(pairs, found)
    return _judged(found, used, pairs, seen)


def _agreed(pairs: list[_Pair], start: Extrinsics) -> tuple[Extrinsics, list[_Pair]]:
    """And the pairs that do not stand out."""
    found, used = start, pairs
    for _ in range(3):
        found = _solve(used, found)
        sizes = [_size(found, pair) for pair in used]
        limit = max(OUTLIER * float(np.median(sizes)), FINE_M)
        kept = [pair for pair, size in zip(used, sizes, strict=True) if size <= limit]
        if len(kept) == len(used) or len(kept) < LEAST_POSES:
            break
        used = kept
    return found, used


def _pose_covariance(sighting: Sighting, camera: CameraModel, pose: tuple[Array, Array]) -> Array:
    """(6, 6): what the corners' scatter about the board leaves open."""
    on_board = sighting.board_m @ pose[0].T

    def pixels(step: Array) -> Array:
        return camera.project(Rotation.from_rotvec(step[:3]).apply(on_board) + pose[1] + step[3:])[0].ravel()

    columns = [(pixels(1e-5 * axis) - pixels(-1e-5 * axis)) / 2e-5 for axis in np.eye(6)]
    jacobian, left = np.stack(columns, axis=1), sighting.pixels.ravel() - pixels(np.zeros(6))
    variance = max(float(left @ left) / max(len(left) - 6, 1), LEAST_PX**2)
    return np.asarray(variance * np.linalg.pinv(jacobian.T @ jacobian))


def _residuals(extrinsics: Extrinsics, pair: _Pair) -> Array:
    across = extrinsics.rotation.T @ pair.normal
    patch = pair.patch
    offset = across @ patch.centre_m + pair.normal @ extrinsics.translation_m - pair.distance_m
    return np.array([offset, *(patch.spread_m * (patch.axes @ across))])


def _size(extrinsics: Extrinsics, pair: _Pair) -> float:
    return float(np.sqrt(np.mean(_residuals(extrinsics, pair) ** 2)))


def _stacked(pairs: Sequence[_Pair], start: Extrinsics) -> Callable[[Array], Array]:
    def stacked(step: Array) -> Array:
        moved = start.moved(step)
        return np.concatenate([pair.white @ _residuals(moved, pair) for pair in pairs])

    return stacked


def _solve(pairs: Sequence[_Pair], start: Extrinsics) -> Extrinsics:
    solution = least_squares(_stacked(pairs, start), np.zeros(6), loss="soft_l1", f_scale=FAR_SIGMAS, x_scale=_SCALE)
    return start.moved(solution.x)


_SCALE = np.array([0.01] * 3 + [0.01] * 3)


def _covariance(pairs: Sequence[_Pair], found: Extrinsics) -> Array:
    """Huge where the poses leave a direction open."""
    stacked, step = _stacked(pairs, found), 1e-5
    columns = [(stacked(step * axis) - stacked(-step * axis)) / (2.0 * step) for axis in np.eye(6)]
    jacobian, left = np.stack(columns, axis=1), stacked(np.zeros(6))
    normal = jacobian.T @ jacobian
    variance = float(left @ left) / max(len(left) - 6, 1)
    normal = normal + np.diag(LOOSEST**-2) * variance
    return np.asarray(variance * np.linalg.inv(normal) + np.diag(FLOOR**2), np.float64)


def _judged(found: Extrinsics, used: Sequence[_Pair], pairs: Sequence[_Pair], seen: Sequence[_Seen]) -> BoardFound:
    covariance = _covariance(used, found)
    residual = float(np.sqrt(np.mean([_size(found, pair) ** 2 for pair in used])))
    reports = [_report(one, found, pairs, used) for one in seen]
    result = BoardFound(found, covariance, residual_m=residual, holds=tuple(reports))
    return replace(result, refusal=_refusal(result, used))


def _report(one: _Seen, found: Extrinsics, pairs: Sequence[_Pair], used: Sequence[_Pair]) -> HoldReport:
    name = one.hold.sighting.name
    pair = next((pair for pair in pairs if pair.seen is one), None)
    if pair is None:
        return HoldReport(name, 0, 0.0, "the LiDAR does not see the board")
    why = "" if any(pair is other for other in used) else "it does not agree with the others"
    return HoldReport(name, pair.patch.points, _size(found, pair), why)


def _refusal(found: BoardFound, used: Sequence[_Pair]) -> str:
    normals = np.array([pair.normal for pair in used])
    second = np.linalg.svd(normals - normals.mean(axis=0))[1][1] / np.sqrt(len(used))
    spread = np.degrees(np.arcsin(min(float(second), 1.0)))
    if spread < 5.0:
        return "the board was held at the same angle each time: tilt it left, right, up and down by 20 to 40 degrees"
    if found.residual_m > WORST_RESIDUAL_M:
        return (
            f"camera and LiDAR disagree by {100 * found.residual_m:.1f} cm about the board: check --square, the "
            "lens, and that nothing moved"
        )
    if found.rotation_sigma_deg > WORST_ROTATION_DEG or found.translation_sigma_m > WORST_TRANSLATION_M:
        return (
            f"uncertain by {found.rotation_sigma_deg:.1f} deg and {100 * found.translation_sigma_m:.1f} cm: "
            "hold the board in more poses, nearer, and tilted more"
        )
    return ""
