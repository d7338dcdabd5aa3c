import dataclasses
import math

import pytest

from drivers.driver import SensorState
from drivers.messages import FixQuality, GnssFix
from drivers.reach.config import Config
from drivers.reach.health import Arrivals, View, fix_details, judge

FIX = GnssFix(
    0,
    0,
    10**18,
    False,
    FixQuality.RTK_FIXED,
    49.0,
    8.4,
    165.0,
    48.1,
    20,
    0.7,
    1.2,
    (0.03, 0.04, 0.06),
    "gst",
    1.0,
    90.0,
)
GOOD = View(
    link_problem="",
    open_s=60.0,
    link_bytes=10_000,
    link_sentences=1000,
    fix=FIX,
    fix_silence_s=0.1,
    recent_hz=5.0,
    damaged_share=0.0,
    address="/dev/mapforest/gnss",
)


def judged(fix=None, **changes):
    view = dataclasses.replace(GOOD, fix=dataclasses.replace(FIX, **(fix or {})), **changes)
    return judge(view, Config())


def test_all_well_says_nothing():
    assert judged() == (SensorState.OK, "", "")
    assert judged({"quality": FixQuality.RTK_FLOAT}) == (SensorState.OK, "", "")


@pytest.mark.parametrize(
    ("changes", "state", "word"),
    [
        ({"link_problem": "/dev/x is gone: check cable and power"}, SensorState.SEARCHING, "gone"),
        ({"link_sentences": 0, "link_bytes": 0, "open_s": 1.0}, SensorState.STARTING, ""),
        ({"link_sentences": 0, "link_bytes": 0}, SensorState.STARTING, "silent"),
        ({"link_sentences": 0}, SensorState.DEGRADED, "no NMEA"),
        ({"fix_silence_s": 0.7}, SensorState.DEGRADED, "no epoch for 0.7 s"),
        ({"fix_silence_s": 7.0}, SensorState.SEARCHING, "no epoch for 7.0 s"),
        ({"fix": {"quality": FixQuality.INVALID}}, SensorState.DEGRADED, "no fix"),
        ({"fix": {"quality": FixQuality.SINGLE}}, SensorState.DEGRADED, "single"),
        ({"fix": {"age_s": 14.0}}, SensorState.DEGRADED, "corrections are 14 s old"),
        ({"damaged_share": 0.05}, SensorState.DEGRADED, "5% of the sentences"),
        ({"recent_hz": 1.0}, SensorState.DEGRADED, "1.0 epochs a second instead of 5"),
        ({"fix": {"sigma_source": "quality table x hdop"}}, SensorState.DEGRADED, "no GST"),
    ],
)
def test_what_is_wrong_is_said_with_what_to_do(changes, state, word):
    found, problem, advice = judged(**changes)
    assert found is state
    assert word in problem
    assert bool(advice) == bool(problem)


def test_nmea_without_gga_is_said():
    view = dataclasses.replace(GOOD, fix=None, fix_silence_s=math.inf)
    assert "without GGA" in judge(view, Config())[1]


def test_the_details_state_what_the_operator_asks_for():
    details = fix_details(FIX)
    assert (details["quality"], details["satellites"], details["correction_age_s"]) == ("RTK fixed", "20", "1.2")
    assert details["sigma_horizontal_m"] == "0.050"
    assert "sigma_horizontal_m" not in fix_details(dataclasses.replace(FIX, sigma_enu_m=(math.nan,) * 3))


def test_rates_and_the_longest_silence_are_of_the_time_since_the_last_look():
    arrivals, second = Arrivals(), 10**9
    arrivals.look(0)
    for k in range(10):
        arrivals.note(k * second // 10)
    assert arrivals.look(second) == (10.0, 0.1)
    arrivals.note(int(1.5 * second))
    assert arrivals.look(3 * second) == (0.5, 1.5)
    assert arrivals.recent_hz(4 * second, 0) is None
    assert arrivals.recent_hz(int(5.5 * second), 0) == pytest.approx(1.0)
