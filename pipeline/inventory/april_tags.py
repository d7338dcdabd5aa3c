"""AprilTags (Olson 2011; family 36h11) on stems: read in images, and hung on the stem that the camera saw them on."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.grounding.views import CameraView
from pipeline.inventory.stem import BREAST_M, Stem

Doubles = npt.NDArray[np.float64]
CORRECTED = 0.2
"""Of the bits that the family can correct: a picture of leaves must not be a number."""
LOWEST_M, HIGHEST_M = 0.2, 3.0
"""Above the ground: where a person hangs a tag."""
FARTHEST_M = 25.0
BESIDE_M, MOST_SIGMAS = 0.04, 2.5
"""Of a ray from the bark: thickness of a tag, and what the axis is off; together with pose and calibration, so many."""
LEAST_VIEWS, LEAST_SHARE = 2, 0.6
"""A tag hangs on a stem that so many views, and such a share of them, say."""


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """A tag in one image. eye_m (3,), ray (3,) unit: in the frame of the map; with their sigmas."""

    number: int
    eye_m: Doubles
    ray: Doubles
    bearing_sigma_rad: float
    eye_sigma_m: float


class TagReader:
    """Reads one image after another. Not thread-safe."""

    def __init__(self) -> None:
        settings = cv2.aruco.DetectorParameters()
        settings.errorCorrectionRate = CORRECTED
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        self._detector = cv2.aruco.ArucoDetector(family, settings)

    def read(self, image: npt.NDArray[np.uint8]) -> dict[int, Doubles]:
        """Number -> pixel (2,) of its middle. image: (h, w, 3) BGR or (h, w)."""
        corners, numbers, _ = self._detector.detectMarkers(image)
        found = zip([] if numbers is None else np.ravel(numbers).tolist(), corners, strict=True)
        return {int(number): _middle(np.asarray(corner, np.float64).reshape(4, 2)) for number, corner in found}


def sightings(read: dict[int, Doubles], view: CameraView) -> list[Sighting]:
    """Of what was read in an image, in the frame of the view."""
    rays = view.model.rays(np.array(list(read.values())).reshape(-1, 2)) @ view.rotation.T
    bearing = float(np.hypot(view.bearing_sigma_rad, view.lasting_rad))
    eye = float(np.hypot(view.position_sigma_m, view.lasting_m))
    return [Sighting(number, view.position_m, ray, bearing, eye) for number, ray in zip(read, rays, strict=True)]


def on_stems(seen: Sequence[Sighting], stems: Sequence[Stem]) -> tuple[dict[int, int], tuple[str, ...]]:
    """Row of a stem -> number of the tag on it; and in words which tags hang on none. Each image votes for the first
    stem that its ray meets."""
    votes: defaultdict[int, list[int | None]] = defaultdict(list)
    for one in seen:
        votes[one.number].append(_first(one, stems))
    hung: dict[int, int] = {}
    for number in sorted(votes, key=lambda number: -len(votes[number])):
        said = [row for row in votes[number] if row is not None]
        row = max(set(said), key=said.count) if said else None
        count = said.count(row) if row is not None else 0
        if row is not None and row not in hung and count >= max(LEAST_VIEWS, LEAST_SHARE * len(said)):
            hung[row] = number
    lost = {number: len(votes[number]) for number in sorted(set(votes) - set(hung.values()))}
    notes = tuple(
        f"AprilTag {number}, read in {count} images, hangs on no measured stem" for number, count in lost.items()
    )
    return hung, notes


def _first(seen: Sighting, stems: Sequence[Stem]) -> int | None:
    """The stem that the ray goes through, or misses by the fewest sigmas; of several the nearest."""
    best, least = None, (MOST_SIGMAS**2, FARTHEST_M)
    level = float(np.hypot(seen.ray[0], seen.ray[1]))
    if level < 0.1:
        return None
    ahead = seen.ray[:2] / level
    for row, stem in enumerate(stems):
        height = BREAST_M
        for _ in range(2):  # a leaning stem stands where it is at the height of the ray
            off = stem.axis_at(height) - seen.eye_m[:2]
            away = float(off @ ahead)
            height = float(seen.eye_m[2] + seen.ray[2] / level * away - stem.base_m[2])
            height = float(np.clip(height, -1.0, HIGHEST_M + 1.0))
        if away < 0.2 or not LOWEST_M <= height <= HIGHEST_M:
            continue
        beside = abs(float(off[1] * ahead[0] - off[0] * ahead[1])) - 0.5 * stem.dbh_m
        sigma = float(np.sqrt((seen.bearing_sigma_rad * away) ** 2 + seen.eye_sigma_m**2 + BESIDE_M**2))
        cost = float(np.floor((max(beside, 0.0) / sigma) ** 2)), away
        if cost < least:
            best, least = row, cost
    return best


def _middle(corners: Doubles) -> Doubles:
    """Where the diagonals cross, which is the middle of the tag also where it is seen aslant."""
    a, b, c, d = corners
    cross = np.linalg.solve(np.column_stack([c - a, b - d]), b - a)
    return np.asarray(a + cross[0] * (c - a))
