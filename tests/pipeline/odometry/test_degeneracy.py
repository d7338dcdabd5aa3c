import numpy as np
import pytest

from pipeline.odometry.config import DegeneracyConfig
from pipeline.odometry.degeneracy import damp, observe


def test_over_a_meadow_the_way_and_the_heading_are_weak():
    information, normal = np.zeros((6, 6)), np.array([0.0, 0.0, 1.0])
    for point in np.random.default_rng(1).uniform([-20, -20, -1], [20, 20, -1], (500, 3)):
        row = np.concatenate([np.cross(point, normal), normal])
        information += np.outer(row, row) / 0.02**2
    seen = observe(information, DegeneracyConfig())
    assert seen.degenerate
    np.testing.assert_allclose(np.abs(seen.weak_attitude), [[0, 0, 1]], atol=1e-6)
    assert len(seen.weak_position) == 2
    assert np.abs(seen.weak_position[:, 2]).max() < 0.1
    kept, _ = damp(information, np.zeros(6), seen, share=0.01)
    assert kept[5, 5] == pytest.approx(information[5, 5], rel=0.02)  # the height is as sure as it was


def test_a_room_is_not_degenerate():
    assert not observe(np.diag([1e6] * 3 + [1e5] * 3).astype(float), DegeneracyConfig()).degenerate
