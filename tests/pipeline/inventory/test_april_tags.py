"""Tags drawn by OpenCV on trunks, seen by a camera that walks past them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.camera import CameraModel
from pipeline.grounding.views import CameraView
from pipeline.inventory.april_tags import TagReader, on_stems, sightings
from pipeline.inventory.stem import Stem

CAMERA = CameraModel(960, 540, (600.0, 600.0), (479.5, 269.5))
FORWARD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Optical axis to the north."""
SIDE_M = 0.16


def stem(x, y, dbh=0.3):
    return Stem(np.array([x, y, 100.0]), np.zeros(2), dbh, 0.01, dbh, -0.01, 0.01, 500, 180.0, 0.9, 0.001)


def view(x, lens=CAMERA):
    return CameraView(0, lens, FORWARD, np.array([x, 0.0, 101.5]), 0.005, 0.02, 0.0175, 0.02)


def tag_corners(place, height=101.4):
    """A board on the south side of a stem, a little turned."""
    turn = np.radians(12.0)
    east, up = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([0.0, 0.0, 1.0])
    middle = np.array([place.base_m[0], place.base_m[1] - 0.5 * place.dbh_m - 0.01, height])
    half = 0.5 * SIDE_M
    return np.array([middle + half * (a * east + b * up) for a, b in ((-1, 1), (1, 1), (1, -1), (-1, -1))])


def picture(seen, tags):
    """What the view shows: tags on white paper before a wood of noise. tags: (number, stem), the farthest first."""
    random = np.random.default_rng(3)
    image = cv2.GaussianBlur(random.integers(40, 120, (540, 960), np.uint8), (9, 9), 0)
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    for number, place in tags:
        drawn = cv2.copyMakeBorder(cv2.aruco.generateImageMarker(family, number, 160), *(20,) * 4, 0, None, 255)
        corners = (tag_corners(place) - seen.position_m) @ seen.rotation
        pixels, _ = CAMERA.project(corners)
        flat = np.array([[19.5, 19.5], [179.5, 19.5], [179.5, 179.5], [19.5, 179.5]], np.float32)
        onto = cv2.getPerspectiveTransform(flat, pixels.astype(np.float32))
        paper = cv2.warpPerspective(np.full_like(drawn, 255), onto, (960, 540))
        image = np.where(paper > 127, cv2.warpPerspective(drawn, onto, (960, 540)), image)
    return cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)


def test_the_middle_of_a_tag_is_where_its_middle_is_seen():
    place, seen = stem(0.5, 4.0), view(0.0)
    (found,) = TagReader().read(picture(seen, [(23, place)])).items()
    middle, _ = CAMERA.project((tag_corners(place).mean(axis=0)[None] - seen.position_m) @ seen.rotation)
    assert found[0] == 23
    np.testing.assert_allclose(found[1], middle[0], atol=0.5)


def test_tags_hang_on_the_stems_that_wear_them_though_others_stand_behind():
    stems = [stem(0.2, 4.0), stem(0.4, 7.0), stem(2.6, 5.0, 0.2), stem(-1.5, 3.0, 0.4)]
    worn = [(401, stems[2]), (7, stems[0]), (12, stems[3])]
    reader, seen = TagReader(), []
    for x in np.arange(-1.5, 3.1, 0.5):
        there = view(x)
        seen += sightings(reader.read(picture(there, worn)), there)
    assert len(seen) > 12
    hung, notes = on_stems(seen, stems)
    assert hung == {0: 7, 2: 401, 3: 12}
    assert notes == ()


def test_a_tag_on_no_stem_and_one_that_was_read_once_are_told():
    nowhere, stems = stem(0.0, 4.0), [stem(8.0, 8.0), stem(3.0, 4.0)]
    reader = TagReader()
    seen = [s for x in (-0.5, 0.0, 0.5) for s in sightings(reader.read(picture(view(x), [(5, nowhere)])), view(x))]
    hung, notes = on_stems(seen, stems)
    assert hung == {}
    assert notes == ("AprilTag 5, read in 3 images, hangs on no measured stem",)
    once = sightings(reader.read(picture(view(3.0), [(9, stems[1])])), view(3.0))
    assert on_stems(once, stems)[0] == {}


@pytest.mark.parametrize("seed", range(3))
def test_a_wood_without_tags_has_none(seed):
    noise = np.random.default_rng(seed).integers(0, 255, (270, 480, 3), np.uint8)
    noise = cv2.resize(noise, (960, 540), interpolation=cv2.INTER_NEAREST)
    assert TagReader().read(noise) == {}
    assert sightings({}, replace(view(0.0))) == []
