import numpy as np
import pytest

from pipeline.grounding.columns import Columns
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.depth import DepthImage
from pipeline.grounding.surroundings import Surroundings
from tests.pipeline.grounding.grove import CAMERA, looking

WALL_M = 1.0
"""Its top, 4 m ahead. The eye is at 1.3 m."""


@pytest.fixture(scope="module")
def columns():
    """Of a tree 8 m ahead behind the wall, one beside it, and one behind the camera."""
    y, z = np.meshgrid(np.arange(-1.0, 1.0, 0.04), np.arange(0.0, WALL_M, 0.04))
    wall = np.column_stack([np.full(y.size, 4.0), y.ravel(), z.ravel()])
    x, y = np.meshgrid(np.arange(0.0, 12.0, 0.2), np.arange(-6.0, 6.0, 0.2))
    ground = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    around = Surroundings.of(np.zeros(3), np.concatenate([wall, ground]))
    depth = DepthImage(looking(0.0, 0.0, 0.0), around, GroundingConfig())
    return Columns.of(np.array([[8.0, 0.0], [8.0, 4.0], [-8.0, 0.0]]), depth)


def row_px(height_m: float, range_m: float = 8.0) -> float:
    return float(CAMERA.project(np.array([[0.0, 1.3 - height_m, range_m]]))[0][0, 1])


def test_a_tree_behind_a_wall_shows_from_above_it(columns):
    assert columns.foot_px[:2] == pytest.approx(row_px(0.0), abs=2.0)
    assert columns.row_px[0] == pytest.approx(row_px(1.0), abs=2.0)  # of the heights asked for: 0.5 is hidden, 1 is not
    assert columns.row_px[1] == pytest.approx(row_px(0.0), abs=2.0)
    assert columns.column_px[0] == pytest.approx(CAMERA.centre_px[0], abs=1.0)
    assert columns.share[2] == 0.0
    assert columns.shown.tolist() == [True, True, False]


def test_a_box_is_amiss_that_ends_above_what_shows_or_below_the_foot(columns):
    assert columns.amiss_px(row_px(2.0))[:2] == pytest.approx(
        [row_px(1.0) - row_px(2.0), row_px(0.0) - row_px(2.0)], abs=4
    )
    assert columns.amiss_px(row_px(0.4))[0] == 0.0
    assert columns.amiss_px(row_px(0.0) + 30.0)[:2] == pytest.approx(30.0, abs=2.0)
