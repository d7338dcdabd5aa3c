from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.odometry.relocate import CELL_M, STEP_RAD, relocate
from pipeline.odometry.state import State


def grove(random):
    stems = random.uniform(-16, 16, (60, 2))
    return np.column_stack([np.repeat(stems, 40, axis=0), random.uniform(-1.0, 4.0, 2400)])


@pytest.mark.parametrize(
    ("yaw_deg", "shift_m"), [(0.0, (0.0, 0.0, 0.0)), (35.0, (2.0, -1.5, 0.4)), (-120.0, (-4.0, 3.0, 0.0))]
)
def test_the_scan_is_found_where_it_was_seen(yaw_deg, shift_m):
    random = np.random.default_rng(1)
    known = grove(random) + np.array([100.0, -50.0, 3.0])
    place, turn = np.array([101.0, -49.0, 3.0]), Rotation.from_euler("ZYX", [40.0, 5.0, -3.0], degrees=True).as_matrix()
    seen = (known[random.random(len(known)) < 0.5] - place) @ turn
    true = State(turn, place, *np.zeros((3, 3)), np.array([0.0, 0.0, -9.8]))
    away = Rotation.from_euler("z", yaw_deg, degrees=True).as_matrix()
    guess = replace(true, rotation=away @ turn, position_m=place + shift_m)
    found = relocate(known, seen, guess, np.radians(50.0), 5.0)
    assert np.abs(found.position_m - place).max() < 2.0 * CELL_M
    assert np.linalg.norm(Rotation.from_matrix(found.rotation @ turn.T).as_rotvec()) < 1.5 * STEP_RAD
    assert found.velocity_m_s is guess.velocity_m_s
