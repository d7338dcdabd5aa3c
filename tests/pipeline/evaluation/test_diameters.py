import numpy as np
import pytest

from pipeline.evaluation.diameters import Diameters, diameter_errors, together

TRUE = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [30.0, 0.0]])
TAPED = np.array([0.20, 0.40, 0.30, 0.06])


def given(places, dbh, sigma=0.01):
    return Diameters(np.array(places), np.array(dbh), np.full(len(dbh), sigma), TRUE, TAPED, np.ones(4, bool))


def test_errors_are_those_of_equation_6_and_its_kin():
    found = diameter_errors(given([[0.1, 0], [10, 0.1], [50, 50], [30, 0]], [0.21, 0.38, 0.5, 0.06]), 0.10)
    assert (found.true, found.found, found.measured, found.made_up, found.missed) == (3, 2, 4, 1, (2,))
    assert found.mre == pytest.approx((0.01 / 0.20 + 0.02 / 0.40) / 2)
    assert found.rmse_m == pytest.approx(np.sqrt((0.01**2 + 0.02**2) / 2))
    assert found.bias_m == pytest.approx(-0.005)
    assert found.z_rms == pytest.approx(np.sqrt((1 + 4) / 2))
    assert found.completeness == pytest.approx(2 / 3)
    assert found.commission == pytest.approx(0.25)


def test_one_stem_is_not_found_twice():
    found = diameter_errors(given([[0.1, 0], [-0.1, 0]], [0.2, 0.2]))
    assert (found.found, found.made_up) == (1, 1)


def test_nothing_measured_is_no_crash():
    found = diameter_errors(given(np.empty((0, 2)), np.empty(0)))
    assert (found.found, found.pairs) == (0, 0)
    assert np.isnan(found.mre)


def test_plots_together_do_not_mix():
    one = given([[0.1, 0]], [0.21])
    found = diameter_errors(together([one, one]))
    assert (found.true, found.found, found.pairs) == (8, 2, 2)
