import math

import numpy as np
import pytest

from pipeline.gnss.alignment import align
from tests.pipeline.gnss.walks import rz

CURVE = np.stack([np.linspace(0, 60, 80), 15 * np.sin(np.linspace(0, 4, 80)), np.linspace(0, 2, 80)], axis=1)
SIGMA = np.tile([0.5, 0.5, 0.8], (80, 1))
ALL = np.ones(80)


@pytest.mark.parametrize("yaw", [-3.1, -1.0, 0.0, 0.5, 3.1])
def test_exact_pairs_give_the_exact_transform(yaw):
    there = CURVE @ rz(yaw).T + [100.0, -50.0, 7.0]
    found = align(CURVE, there, SIGMA, ALL)
    assert math.remainder(found.yaw - yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)
    assert found.to_map(CURVE[3]) == pytest.approx(there[3], abs=1e-9)


def test_it_is_the_kabsch_solution():
    """Oracle: the rotation by singular value decomposition. The noise is small, so that every weight is one."""
    random = np.random.default_rng(2)
    there = CURVE @ rz(0.7).T + 0.1 * random.standard_normal(CURVE.shape)
    e, g = CURVE[:, :2] - CURVE[:, :2].mean(0), there[:, :2] - there[:, :2].mean(0)
    u, _, v = np.linalg.svd(e.T @ g)
    rotation = (u @ v).T
    found = align(CURVE, there, SIGMA, ALL)
    assert found.yaw == pytest.approx(math.atan2(rotation[1, 0], rotation[0, 0]), abs=1e-12)


def test_its_sigma_is_what_it_errs_by():
    random = np.random.default_rng(3)
    runs = [
        align(CURVE, CURVE @ rz(0.7).T + SIGMA * random.standard_normal(CURVE.shape), SIGMA, ALL) for _ in range(200)
    ]
    errors = np.array([run.yaw - 0.7 for run in runs])
    # The Huber weights cost a few percent of efficiency.
    assert errors.std() == pytest.approx(np.mean([run.yaw_sigma for run in runs]), rel=0.2)


def test_a_fifth_of_gross_outliers_turns_it_little():
    random = np.random.default_rng(4)
    there = CURVE @ rz(0.7).T + 0.5 * random.standard_normal(CURVE.shape)
    there[20:36] += [10.0, -10.0, 4.0]
    assert math.degrees(align(CURVE, there, SIGMA, ALL).yaw) == pytest.approx(math.degrees(0.7), abs=3.0)


def test_standing_still_it_knows_no_yaw():
    still = np.zeros((80, 3))
    found = align(still, 0.5 * np.random.default_rng(5).standard_normal((80, 3)), SIGMA, ALL)
    assert math.degrees(found.yaw_sigma) > 90.0
