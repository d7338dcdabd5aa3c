import math

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.odometry.config import DriftConfig
from pipeline.odometry.drift import Drift

CONFIG = DriftConfig(yaw_deg_per_root_m=0.5, horizontal=0.01, vertical=0.005, correlated_m=10.0, tilt_lasts_m=10.0)


def way():
    """Steps (n, 3) of a bend of 30 m."""
    heading = np.linspace(0.0, 2.0, 150)
    return 0.2 * np.column_stack([np.cos(heading), np.sin(heading), 0.05 * np.ones(150)])


def test_the_covariance_is_that_of_many_drifting_walks():
    """Oracle: walks whose yaw and place stagger at random, metre by metre."""
    random, steps, count = np.random.default_rng(1), way(), 4000
    drift = Drift(CONFIG)
    yaw, place = np.zeros(count), np.zeros((count, 3))
    for step in steps:
        length = np.linalg.norm(step)
        place[:, 0] -= step[1] * yaw
        place[:, 1] += step[0] * yaw
        kick = np.sqrt(length * CONFIG.correlated_m) * random.standard_normal((count, 3))
        place += kick * [CONFIG.horizontal, CONFIG.horizontal, CONFIG.vertical]
        yaw += math.radians(CONFIG.yaw_deg_per_root_m) * math.sqrt(length) * random.standard_normal(count)
        drift.move(step)
    found = drift.add_to(np.zeros((6, 6)), np.eye(3))[2:, 2:]
    expected = np.cov(np.column_stack([yaw, place]).T)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(found / scale, expected / scale, atol=0.1)


def test_standing_still_nothing_drifts():
    drift = Drift(CONFIG)
    for _ in range(100):
        drift.move(np.zeros(3), 3.0)
    assert not drift.add_to(np.zeros((6, 6)), np.eye(3)).any()


def test_yaw_turns_about_the_vertical_however_the_body_is_held():
    drift = Drift(CONFIG)
    drift.widen(0.0, 0.3)
    rotation = Rotation.from_euler("xyz", [0.5, -0.7, 1.0]).as_matrix()
    attitude = drift.add_to(np.zeros((6, 6)), rotation)[:3, :3]
    np.testing.assert_allclose(rotation @ attitude @ rotation.T, np.diag([0.0, 0.0, 0.09]), atol=1e-12)


def test_along_a_direction_that_is_not_seen_the_error_grows_with_the_way():
    drift, seen = Drift(CONFIG), Drift(CONFIG)
    for _ in range(100):
        drift.move(np.array([0.1, 0.0, 0.0]), weak=np.array([[1.0, 0.0, 0.0]]))
        seen.move(np.array([0.1, 0.0, 0.0]))
    grown = drift.add_to(np.zeros((6, 6)), np.eye(3)) - seen.add_to(np.zeros((6, 6)), np.eye(3))
    assert math.sqrt(grown[3, 3]) == pytest.approx(CONFIG.weak * 10.0)
    grown[3, 3] = 0.0
    np.testing.assert_allclose(grown, 0.0, atol=1e-12)


def test_a_scan_now_and_then_that_does_not_see_it_costs_little():
    drift = Drift(CONFIG)
    for k in range(100):
        drift.move(np.array([0.1, 0.0, 0.0]), weak=np.array([[1.0, 0.0, 0.0]]) if k % 10 == 0 else np.empty((0, 3)))
    assert math.sqrt(drift.add_to(np.zeros((6, 6)), np.eye(3))[3, 3]) < 0.2 * CONFIG.weak * 10.0


def test_a_tilt_lifts_the_way_until_it_is_known():
    """Oracle: walks on level ground whose vertical is off by what lasts; after 10 m it is measured, to a fifth."""
    random, count, tilt, step_m = np.random.default_rng(2), 20000, math.radians(1.0), 0.1
    level = msgspec.structs.replace(CONFIG, vertical=0.0)
    drift, height, slope = Drift(level), np.zeros(count), tilt * random.standard_normal(count)
    kept = math.exp(-step_m / level.tilt_lasts_m)
    for k in range(200):
        if k == 100:
            measured = slope + tilt * math.sqrt(0.04 / 0.96) * random.standard_normal(count)
            slope, tilt = slope - 0.96 * measured, 0.2 * tilt
        slope = kept * slope + math.sqrt(1.0 - kept**2) * tilt * random.standard_normal(count)
        height += step_m * slope
        drift.move(np.array([step_m, 0.0, 0.0]), tilt=tilt**2)
    found = drift.add_to(np.zeros((6, 6)), np.eye(3))
    assert math.sqrt(found[5, 5]) == pytest.approx(height.std(), rel=0.05)
