"""Camera and LiDAR from what both see while the payload stands still; no target (after Yuan et al. 2021).

Where the LiDAR sees a stem end, the picture should change across that line. The sum of the picture's contrast under all
such points, as a function of the pose, is climbed from coarse to fine (the picture is blurred less and less), from the
guess and from others around it: a right answer is one that all of them reach, and that stands out from the rest.

A seventh unknown moves all edges outward by some pixels: beams are wide, and a thing seems wider or narrower by half.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from pipeline.calibration.board import Image
from pipeline.calibration.edge_kernels import sample
from pipeline.calibration.errors import CalibrationError
from pipeline.calibration.extrinsics import Extrinsics, Found
from pipeline.calibration.image_edges import Strength, blurred, edge_strength, facing
from pipeline.calibration.laser_edges import LaserEdges, find_edges
from pipeline.calibration.turning import Array
from pipeline.calibration.view import Straightener
from pipeline.camera import CameraModel

BLURS_PX = (8.0, 4.0, 2.0, 1.0)
SCALE = np.array([np.radians(1.0)] * 3 + [0.03] * 3 + [1.0])
STARTS = 5
START_DEG, START_M = 1.5, 0.03
AGREED_DEG, AGREED_M = 0.3, 0.03
LEAST_EDGES = 300
LEAST_PLACES = 3
"""The edges of one place can agree on a wrong pose: in 2 of 20 simulated ones by 0.6 degrees, where 0.2 were told."""
LEAST_STANDOUT = 6.0
WORST_ROTATION_DEG, WORST_TRANSLATION_M = 0.4, 0.04
FLOOR = np.array([np.radians(0.08)] * 3 + [0.010] * 3)
"""What scatter over the edges does not show, measured on simulated scenes: beams, bark and shade are wrong alike."""
LOOSEST = np.array([np.radians(5.0)] * 3 + [0.15] * 3 + [3.0])
"""Nothing is less sure than that: the guess was better."""


@dataclass(frozen=True, slots=True, eq=False)
class Stand:
    """One place. image_bgr, and points_m (n, 3) in `livox_frame` at the instant of the picture."""

    image_bgr: Image
    points_m: Array


@dataclass(frozen=True, slots=True, eq=False)
class SceneFound(Found):
    """standout: contrast there over elsewhere, in standard deviations. agreed: share of the starts that came here."""

    edges: int = 0
    standout: float = 0.0
    agreed: float = 0.0


@dataclass(slots=True, eq=False)
class _Place:
    edges: LaserEdges
    facing: npt.NDArray[np.int64]
    strength: Strength
    field: Strength


def from_scene(
    stands: Sequence[Stand], camera: CameraModel, guess: Extrinsics, advance: Callable[[float], None] = lambda _: None
) -> SceneFound:
    """guess: measured by hand, up to 3 degrees and 5 cm off. CalibrationError when there is next to nothing to see."""
    straight = Straightener.of(camera)
    places = []
    for number, stand in enumerate(stands):
        edges = find_edges(stand.points_m, guess, straight.pinhole)
        strength = edge_strength(straight.straight(stand.image_bgr))
        places.append(_Place(edges, facing(edges.outward), strength, strength))
        advance(0.4 * (number + 1) / len(stands))
    count = sum(len(place.edges) for place in places)
    if count < LEAST_EDGES:
        raise CalibrationError(
            f"{count} points of edges at {len(stands)} places, at least {LEAST_EDGES} are needed: stand still for "
            "three seconds where stems, posts or walls are 2 to 15 m before the camera; without any, use a board"
        )
    problem = _Problem(places, straight.pinhole)
    ends = []
    for number, start in enumerate(_starts(guess)):
        ends.append(problem.climb(start))
        advance(0.4 + 0.6 * (number + 1) / STARTS)
    return _judged(problem, ends, count)


def _starts(guess: Extrinsics) -> list[Extrinsics]:
    rng = np.random.default_rng(1)
    steps = [np.zeros(6)]
    for _ in range(STARTS - 1):
        turn, shift = rng.normal(size=3), rng.normal(size=3)
        steps.append(np.r_[np.radians(START_DEG) * _unit(turn), START_M * _unit(shift)])
    return [guess.moved(step) for step in steps]


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


@dataclass(frozen=True, slots=True, eq=False)
class _End:
    extrinsics: Extrinsics
    outward_px: float
    value: float


class _Problem:
    """The sum of contrasts and its derivatives."""

    def __init__(self, places: Sequence[_Place], pinhole: CameraModel) -> None:
        self.places = places
        self._focal = pinhole.focal_px[0]
        self._centre = np.array(pinhole.centre_px)
        self._count = sum(len(place.edges) for place in places)

    def blur(self, sigma_px: float) -> None:
        """Look at pictures blurred so much from now on."""
        for place in self.places:
            place.field = blurred(place.strength, sigma_px)

    def climb(self, start: Extrinsics) -> _End:
        """From coarse to fine."""
        at, outward_px, value = start, 0.0, 0.0
        for sigma_px in BLURS_PX:
            self.blur(sigma_px)

            def lost(scaled: Array, at: Extrinsics = at, outward_px: float = outward_px) -> tuple[float, Array]:
                step = scaled * SCALE
                gained, slope = self.total(at.moved(step[:6]), outward_px + step[6])
                return -gained, -slope * SCALE

            ended = minimize(lost, np.zeros(7), jac=True, method="L-BFGS-B", options={"maxiter": 50})
            step = ended.x * SCALE
            at, outward_px, value = at.moved(step[:6]), outward_px + float(step[6]), -float(ended.fun)
        return _End(at, outward_px, value)

    def total(self, at: Extrinsics, outward_px: float) -> tuple[float, Array]:
        """Mean contrast, and its slope (7,)."""
        value, slope = 0.0, np.zeros(7)
        for place in self.places:
            values, slopes = self.each(place, at, outward_px)
            value += float(values.sum())
            slope += slopes.sum(axis=0)
        return value / self._count, slope / self._count

    def each(self, place: _Place, at: Extrinsics, outward_px: float) -> tuple[Array, Array]:
        """Contrast (n,) and its slope (n, 7) of every point of one place."""
        x, y, z = (seen := at.apply(place.edges.points_m)).T
        z = np.maximum(z, 0.1)
        pixels = self._focal * seen[:, :2] / z[:, None] + self._centre + outward_px * place.edges.outward
        values, by_pixel = np.empty(len(seen)), np.empty((len(seen), 2))
        sample(place.field, place.facing, pixels, values, by_pixel)
        along_x, along_y = self._focal * by_pixel[:, 0] / z, self._focal * by_pixel[:, 1] / z
        by_point = np.column_stack([along_x, along_y, -(along_x * x + along_y * y) / z])
        outward = np.sum(by_pixel * place.edges.outward, axis=1)
        return values, np.column_stack([np.cross(seen, by_point), by_point, outward])

    def covariance(self, end: _End) -> Array:
        """(6, 6), from the curvature and the scatter of the slopes over things: H^-1 V H^-1 (Huber 1967)."""
        steps = 0.1 * SCALE * np.array([1.0] * 6 + [2.0])
        curvature = np.zeros((7, 7))
        for axis, size in enumerate(steps):
            step = np.eye(7)[axis] * size
            ahead, behind = (
                self.total(end.extrinsics.moved(sign * step[:6]), end.outward_px + sign * step[6])[1]
                for sign in (1, -1)
            )
            curvature[:, axis] = (ahead - behind) / (2.0 * size)
        curvature = -0.5 * self._count * (curvature + curvature.T)
        grouped = np.vstack([self._by_cluster(place, end) for place in self.places])
        scatter = grouped.T @ grouped * len(grouped) / max(len(grouped) - 1, 1)
        # A direction without curvature is one that nothing tells.
        values, vectors = np.linalg.eigh(curvature * np.outer(LOOSEST, LOOSEST))
        inverse = (vectors / np.maximum(values, 1.0)) @ vectors.T * np.outer(LOOSEST, LOOSEST)
        told = (inverse @ scatter @ inverse)[:6, :6] + np.diag(FLOOR**2)
        return np.asarray(np.linalg.inv(np.linalg.inv(told) + np.diag(LOOSEST[:6] ** -2)), np.float64)

    def _by_cluster(self, place: _Place, end: _End) -> Array:
        slopes = self.each(place, end.extrinsics, end.outward_px)[1]
        _, group = np.unique(place.edges.cluster, return_inverse=True)
        grouped = np.zeros((int(group.max(initial=-1)) + 1, 7))
        np.add.at(grouped, group, slopes)
        return grouped

    def standout(self, end: _End) -> float:
        """Contrast at the end over that at turned poses around, in standard deviations of the latter."""
        rng = np.random.default_rng(2)
        turns = [np.radians(rng.uniform(2.0, 6.0)) * _unit(rng.normal(size=3)) for _ in range(60)]
        values = [self.total(end.extrinsics.moved(np.r_[turn, np.zeros(3)]), end.outward_px)[0] for turn in turns]
        there, _ = self.total(end.extrinsics, end.outward_px)
        return float((there - np.mean(values)) / max(float(np.std(values)), 1e-9))


def _judged(problem: _Problem, ends: Sequence[_End], edges: int) -> SceneFound:
    best = max(ends, key=lambda end: end.value)
    near = [_same(end.extrinsics, best.extrinsics) for end in ends]
    found = SceneFound(
        best.extrinsics,
        problem.covariance(best),
        edges=edges,
        standout=problem.standout(best),
        agreed=float(np.mean(near)),
    )
    return replace(found, refusal=_refusal(found, len(problem.places)))


def _same(one: Extrinsics, two: Extrinsics) -> bool:
    step = one.step_from(two)
    return bool(
        np.degrees(np.linalg.norm(step[:3])) < AGREED_DEG and np.linalg.norm(one.camera_m - two.camera_m) < AGREED_M
    )


def _refusal(found: SceneFound, places: int) -> str:
    more = "stand still at more places, with stems or posts near and far, and roll the payload by 60 degrees at some"
    if found.standout < LEAST_STANDOUT:
        return (
            f"no pose of the camera stands out from the others ({found.standout:.1f} standard deviations): is the "
            f"guess within 3 degrees, and the lens calibrated? Otherwise {more}; or use a board"
        )
    if found.agreed < 0.6:
        return f"different guesses end at different poses ({found.agreed:.0%} agree): {more}; or use a board"
    if found.rotation_sigma_deg > WORST_ROTATION_DEG or found.translation_sigma_m > WORST_TRANSLATION_M:
        return (
            f"uncertain by {found.rotation_sigma_deg:.1f} deg and {100 * found.translation_sigma_m:.0f} cm: {more}; "
            "or use a board"
        )
    if places < LEAST_PLACES:
        return f"seen from {places} places, at least {LEAST_PLACES} are needed: {more}; or use a board"
    return ""
