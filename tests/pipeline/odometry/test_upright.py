import math
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.odometry.state import State
from pipeline.odometry.upright import Upright


def tilted(degrees, position=(0.0, 0.0, 0.0)):
    gravity = Rotation.from_euler("xy", [0.5 * degrees, degrees], degrees=True).apply([0.0, 0.0, -9.8])
    return State(np.eye(3), np.array(position), *np.zeros((3, 3)), gravity)


def test_gravity_ends_up_straight_down_and_nothing_jumps():
    upright, state = Upright(), tilted(0.0)
    upright.follow(state)
    for k in range(1, 50):
        moved = replace(tilted(0.1 * k), position_m=np.array([0.3 * k, 0.1 * k, 0.0]))
        before = upright.position(moved)
        upright.follow(moved)
        np.testing.assert_allclose(upright.turn @ moved.gravity_m_s2, [0.0, 0.0, -9.8], atol=1e-9)
        np.testing.assert_allclose(upright.position(moved), before, atol=1e-9)
        np.testing.assert_allclose(upright.turn @ upright.turn.T, np.eye(3), atol=1e-9)


def test_heading_is_kept():
    upright = Upright()
    for k in range(20):
        upright.follow(tilted(0.2 * k))
    ahead = upright.turn @ [1.0, 0.0, 0.0]
    assert abs(math.atan2(ahead[1], ahead[0])) < math.radians(0.2)


def test_a_climb_along_a_tilted_frame_comes_out_level():
    """The filter's frame leans by 2 degrees: level ground climbs in it."""
    upright, state = Upright(), tilted(2.0)
    upright.follow(state)
    across = np.cross(np.cross(state.gravity_m_s2, [1.0, 0.0, 0.0]), state.gravity_m_s2)
    walked = replace(state, position_m=-50.0 * across / np.linalg.norm(across))
    assert abs(walked.position_m[2]) > 1.0
    assert abs(upright.position(walked)[2]) < 1e-9
