from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.calibration.errors import CalibrationError
from pipeline.calibration.lag import find_lag
from pipeline.calibration.offset import find_offset
from pipeline.calibration.turning import Turning
from tests.pipeline.calibration.turns import MOUNTED, SECOND, Turns


@pytest.mark.parametrize("late_s", [-0.4, 0.0, 0.0834, 1.37])
@pytest.mark.parametrize("seed", [1, 2])
def test_the_offset_is_found_to_a_millisecond_and_its_sigma_is_honest(late_s, seed):
    turns = Turns(seed, 30.0)
    found = find_offset(turns.camera(late_s), turns.gyro())
    assert not found.refusal
    assert -found.later_s == pytest.approx(late_s, abs=1e-3)
    assert abs(-found.later_s - late_s) < 3.0 * found.sigma_s < 9e-3
    off = Rotation.from_matrix(found.rotation) * MOUNTED  # camera from body, body from camera
    assert np.degrees(off.magnitude()) < 0.3


def test_the_rough_lag_does_not_need_the_mounting():
    turns = Turns(4, 20.0)
    lag = find_lag(turns.camera(0.5), turns.gyro(), -2.0, 2.0)
    assert lag.later_s == pytest.approx(-0.5, abs=0.021)
    assert lag.correlation > 0.95 > lag.rival + 0.2


def test_a_drifting_clock_is_told_over_minutes():
    turns = Turns(5, 240.0)
    found = find_offset(turns.camera(0.2, drift=40e-6), turns.gyro())
    # a stamp grows by 1 + drift a second of the body
    assert -found.drift == pytest.approx(40e-6, abs=8e-6)
    centre_s = found.at_ns / SECOND
    assert -found.later_s == pytest.approx(0.2 + 40e-6 * (centre_s - 0.2), abs=1e-3)


def test_clocks_a_day_apart_are_put_together_where_that_is_allowed():
    turns, day_s = Turns(6, 25.0), 86_400.0
    found = find_offset(turns.camera(0.1).shifted(round(day_s * SECOND)), turns.gyro(), -day_s - 5.0, -day_s + 5.0)
    assert -found.later_s - day_s == pytest.approx(0.1, abs=1e-3)


def test_a_gyroscope_with_holes_still_serves():
    turns = Turns(7, 40.0)
    gyro = turns.gyro()
    kept = np.abs(gyro.begin_ns / SECOND - 12.0) > 1.5
    found = find_offset(turns.camera(0.3), Turning(gyro.begin_ns[kept], gyro.end_ns[kept], gyro.rate[kept]))
    assert not found.refusal
    assert -found.later_s == pytest.approx(0.3, abs=1.5e-3)


def test_standing_still_cannot_be_told():
    turns = Turns(8, 30.0, size_rad=1e-4)
    assert "hardly any turning" in find_offset(turns.camera(0.1, noise_rad_s=0.002), turns.gyro()).refusal


def test_two_bodies_cannot_be_told():
    assert "do not turn alike" in find_offset(Turns(9, 30.0).camera(0.1), Turns(10, 30.0).gyro()).refusal


def test_a_motion_that_repeats_itself_cannot_be_told():
    at = np.arange(0.0, 40.0, 0.01)
    stamps = np.round(at * SECOND).astype(np.int64)
    rate = np.sin(2.0 * np.pi * at)[:, None] * [0.5, 0.3, 0.1]
    swing = Turning(stamps[:-1], stamps[1:], rate[:-1])
    assert "two offsets fit" in find_offset(swing.within(5 * SECOND, 35 * SECOND), swing).refusal


def test_a_short_recording_cannot_be_told():
    turns = Turns(11, 6.0)
    assert "record for half a minute" in find_offset(turns.camera(0.1), turns.gyro()).refusal


def test_recordings_of_different_days_have_nothing_in_common():
    turns = Turns(12, 10.0)
    with pytest.raises(CalibrationError, match="less than 4 s in common"):
        find_offset(turns.camera(0.0).shifted(3600 * SECOND), turns.gyro())


def test_the_sign_is_that_of_a_stamp_that_comes_later():
    turns = Turns(13, 20.0)
    camera = turns.camera(0.0)
    late = replace(camera, begin_ns=camera.begin_ns + 50_000_000, end_ns=camera.end_ns + 50_000_000)
    assert -find_offset(late, turns.gyro()).later_s == pytest.approx(0.05, abs=1e-3)
