"""Entropy, thickness and distances of surfaces, beside scipy and clouds whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from scipy.stats import multivariate_normal

from pipeline.evaluation.sharpness import LEAST, apart, around

RADIUS_M = 0.3


def plane(count=4000, *, sigma_m=0.0, height_m=0.0, seed=1, side_m=2.0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(0.0, side_m, (count, 2)), height_m + rng.normal(0.0, sigma_m, count)])


def inner(xyz, side_m=2.0):
    """Rows with all of their surroundings on the plane."""
    return np.flatnonzero(((xyz[:, :2] > RADIUS_M) & (xyz[:, :2] < side_m - RADIUS_M)).all(axis=1))


def test_entropy_and_thickness_are_those_of_a_gaussian_fitted_to_each_neighbourhood():
    xyz = np.vstack([plane(400, sigma_m=0.02), [[9.0, 9.0, 9.0]]])
    places = np.arange(0, 401, 10)
    found = around(xyz, places, RADIUS_M)
    entropy, thickness = [], []
    for row in places:
        near = xyz[cdist(xyz[row : row + 1], xyz)[0] <= RADIUS_M]
        if len(near) < LEAST:
            continue
        entropy.append(multivariate_normal(cov=np.cov(near.T)).entropy())
        _, _, axes = np.linalg.svd(near - near.mean(axis=0))
        away = np.abs((near - near.mean(axis=0)) @ axes[2])
        thickness.append(np.quantile(away, 0.75, method="inverted_cdf"))
    assert len(entropy) == len(places) - 1  # the stray has no neighbours
    assert found.entropy == pytest.approx(entropy)
    assert found.thickness_m == pytest.approx(thickness)


def test_thickness_is_the_upper_quartile_of_the_noise_and_grows_with_a_double_wall():
    xyz = plane(20_000, sigma_m=0.01)
    places = inner(xyz)[::20]
    single = around(xyz, places, RADIUS_M)
    assert single.thickness_m.mean() == pytest.approx(1.1503 * 0.01, rel=0.05)  # of |N(0, 1)|
    assert single.flat.all()
    double = xyz + np.where(np.arange(len(xyz)) % 2, 0.05, 0.0)[:, None] * [0.0, 0.0, 1.0]
    shown = around(double, places, RADIUS_M)
    assert shown.thickness_m.mean() > 0.025
    assert (shown.entropy - single.entropy).mean() == pytest.approx(0.5 * np.log(1.0 + 0.025**2 / 0.01**2), abs=0.05)


def test_leaves_are_no_surface():
    xyz = np.random.default_rng(2).uniform(0.0, 1.0, (5000, 3))
    places = np.flatnonzero((np.abs(xyz - 0.5) < 0.2).all(axis=1))[:100]
    assert around(xyz, places, RADIUS_M).flat.mean() < 0.05
    assert len(apart(xyz, places, lambda rows, _: rows % 2 == 0, np.arange(5000.0), RADIUS_M).distance_m) < 5


@pytest.mark.parametrize("offset_m", [0.0, 0.04, -0.1])
@pytest.mark.parametrize("upright", [False, True])
def test_the_distance_of_two_passes_is_the_offset_between_them(offset_m, upright):
    xyz = np.vstack([plane(4000, sigma_m=0.01, seed=1), plane(4000, sigma_m=0.01, height_m=offset_m, seed=2)])
    late = np.arange(8000) >= 4000
    places = inner(xyz)[::40]
    if upright:
        xyz = xyz[:, [2, 0, 1]]
    found = apart(xyz, places, lambda rows, at: late[rows] != late[at], 1.0 * late, RADIUS_M)
    assert len(found.distance_m) == len(places)
    assert found.level.all() != upright
    assert np.median(np.abs(found.distance_m) if upright else found.distance_m) == pytest.approx(
        abs(offset_m) if upright else offset_m, abs=0.004
    )


def test_nothing_in_is_nothing_out():
    none = np.empty(0, np.intp)
    assert len(around(np.empty((0, 3)), none, RADIUS_M).entropy) == 0
    assert len(apart(np.empty((0, 3)), none, lambda rows, _: rows > 0, np.empty(0), RADIUS_M).distance_m) == 0
