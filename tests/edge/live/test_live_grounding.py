"""Boxes and poses as they come live: late, early, and over an odometry that begins anew."""

import numpy as np
import pytest

from edge.live.grounding import LiveGrounding
from edge.process.sweep_odometry import Tracked
from pipeline.estimates import OdometryEstimate
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.views import CameraRig
from tests.pipeline.grounding.grove import CAMERA, SECOND, Grove, Trunk

TURN = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
RIG = CameraRig(CAMERA, TURN, np.zeros(3))
GROVE = Grove([Trunk(2, 4, target=True), Trunk(0, 7), Trunk(8, 3)], recall=0.9)


def tracked(view, stamp_ns, travelled_m):
    zero = np.zeros(3)
    rotation = view.rotation @ TURN.T
    points = GROVE.around(view.position_m, 25.0)[::7]
    estimate = OdometryEstimate(stamp_ns, view.position_m, rotation, zero, np.eye(6) * 1e-4, zero, zero, travelled_m,
                                False, np.empty((0, 3)), 1, 1)  # fmt: skip
    return Tracked(estimate, np.column_stack([points, np.zeros(len(points))]).astype(np.float32))


def walked(late: int, grounding=None):
    """Boxes come `late` views after their image."""
    grounding = grounding or LiveGrounding(RIG, GroundingConfig())
    held, last = [], None
    for k, (view, found) in enumerate(GROVE.walk()):
        for shift_ms in (-60, 40):
            last = tracked(view, view.stamp_ns + SECOND + shift_ms * 1_000_000, 0.6 * k)
            grounding.track(last)
        held.append(type(found)(found.stamp_ns + SECOND, *(getattr(found, name) for name in
                    ("width_px", "height_px", "boxes_px", "confidence", "class_id", "class_names"))))  # fmt: skip
        if k >= late:
            grounding.see(held[k - late])
    return grounding, last.estimate


@pytest.mark.parametrize("late", [0, 3])
def test_the_tree_is_found_and_the_operator_told_where(late):
    grounding, estimate = walked(late)
    told = grounding.mapped(estimate)
    away = np.array([2.0, 4.0]) - estimate.position_m[:2]
    assert told.trees == 1
    assert told.range_m == pytest.approx(np.hypot(*away), abs=0.8)
    heading = 0.6
    expected = np.degrees(heading - np.arctan2(away[1], away[0])) % 360
    assert told.bearing_deg == pytest.approx(expected, abs=6)
    assert 0 < told.sigma_m < 1.0


def test_before_anything_there_is_nothing_to_tell():
    grounding = LiveGrounding(RIG, GroundingConfig())
    assert grounding.mapped(None).trees == 0
    assert grounding.mapped(None).range_m is None


def test_an_odometry_that_begins_anew_begins_an_empty_map():
    grounding, _ = walked(0)
    view, _ = next(iter(GROVE.walk()))
    again = tracked(view, 100 * SECOND, 0.0)
    grounding.track(again)
    assert grounding.mapped(again.estimate).trees == 0


def test_images_of_another_shape_are_not_used():
    grounding = LiveGrounding(RIG, GroundingConfig())
    view, found = next(iter(GROVE.walk()))
    for t in (-50, 50):
        grounding.track(tracked(view, SECOND + t * 1_000_000, 0.0))
    values = {name: getattr(found, name) for name in ("boxes_px", "confidence", "class_id", "class_names")}
    grounding.see(type(found)(SECOND, 640, 480, **values))
    assert grounding.mapped(None).views == 0
