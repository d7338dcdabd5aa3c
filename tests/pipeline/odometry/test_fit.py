import pytest

from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.estimate import Residuals
from pipeline.odometry.filter import SURPRISING
from pipeline.odometry.fit import Fit, Fitting


def scan(share=0.9, squared=1.4, surprise=0.5, clusters=1000):
    return Residuals(10_000, clusters, int(share * clusters), squared, 0.95, 2, surprise)


@pytest.fixture
def used_to_good_scans():
    fitting = Fitting(OdometryConfig())
    for _ in range(20):
        assert fitting.judge(scan(), 0.005) is Fit.GOOD
    return fitting


def test_a_scan_that_meets_hardly_anything_does_not_fit(used_to_good_scans):
    assert used_to_good_scans.judge(scan(share=0.1), 0.005) is Fit.NONE
    assert used_to_good_scans.judge(scan(clusters=0), 0.005) is Fit.NONE


def test_a_poor_fit_alone_is_no_reason_nor_is_surprise(used_to_good_scans):
    assert used_to_good_scans.judge(scan(squared=5.0), 0.005) is Fit.GOOD
    assert used_to_good_scans.judge(scan(surprise=3.0 * SURPRISING), 0.005) is Fit.GOOD


@pytest.mark.parametrize("worse", [{"squared": 6.0}, {"share": 0.4}])
def test_surprise_or_silence_with_a_poor_fit_is_the_wrong_place(used_to_good_scans, worse):
    assert used_to_good_scans.judge(scan(surprise=3.0 * SURPRISING, **worse), 0.005) is Fit.WRONG
    assert used_to_good_scans.judge(scan(**worse), 2.0) is Fit.WRONG
    assert used_to_good_scans.judge(scan(), 2.0) is Fit.GOOD


def test_what_is_usual_changes_with_the_forest(used_to_good_scans):
    for _ in range(100):
        used_to_good_scans.judge(scan(share=0.5, squared=3.0), 0.005)
    assert used_to_good_scans.judge(scan(share=0.5, squared=3.0), 2.0) is Fit.GOOD
