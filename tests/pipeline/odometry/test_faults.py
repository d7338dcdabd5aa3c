"""Every fault of the catalogue on a short walk: none ends in an estimate that is off and does not say so.

The figures stand in `docs/odometry-faults.md`.
"""

import pytest

from benchmarks.odometry.faults.catalogue import CASES, cast
from benchmarks.odometry.faults.trial import tried
from pipeline.odometry.estimate import Status

SMALL_M = 0.1
HARMLESS = (
    *("walkers", "companions", "wind", "dust_tagged", "dust", "rain", "covered", "thin", "ground", "not_finite"),
    *("packets_5", "packets_30", "samples_10", "in_g", "late_fifth", "scans_disordered", "samples_disordered"),
)
"""Nothing need be said."""
ENDURED = {
    "crown": Status.COASTING,
    "elsewhere": Status.COASTING,
    "empty": Status.COASTING,
    "handful": Status.DEGENERATE,
    "laser_2": "no points",
    "laser_6": "no points",
    "late": "no points",
    "samples_02": "no inertial samples",
    "samples_07": "no inertial samples",
    "samples_3": "no inertial samples",
    "silence_3": "no inertial samples",
    "saturated_unknown": Status.DOUBTFUL,
    "gyro_bias": Status.DOUBTFUL,
    "gyro_bias_large": Status.DOUBTFUL,
    "accel_bias": Status.DOUBTFUL,
    "accel_bias_large": Status.DOUBTFUL,
    "leap_scan": "elsewhere in time",
    "leap_sample": "elsewhere in time",
    "leap_second": "elsewhere in time",
    "leap_on": "no points",
}
"""Told while it lasts, and the way is found again."""
SUFFERED = {
    "field": Status.DEGENERATE,
    "silence_8": Status.RESTARTED,
    "leap_back": "went back",
    "in_g_midway": Status.DOUBTFUL,
    "offset_20": Status.DOUBTFUL,
    "mounted_pitch": Status.DOUBTFUL,
    "saturated": "reached its range",
}
"""Told, and what is off is within what is stated."""
BLIND = {"mounted_yaw": Status.DOUBTFUL}
"""Told, but the stated sigma does not cover it: all is turned by the same angle."""
QUICK = {"not_finite", "crown", "silence_3", "leap_second", "mounted_pitch"}


def cases(names):
    return [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in names]


def said(outcome, what):
    return outcome.statuses[what] > 0 if isinstance(what, Status) else any(what in note for note in outcome.notes)


@pytest.mark.parametrize("name", cases(HARMLESS))
def test_it_does_no_harm(streams, name):
    outcome = tried(CASES[name], streams)
    assert outcome.worst_m < SMALL_M
    assert outcome.end_m < SMALL_M
    assert outcome.outside < 0.01


@pytest.mark.parametrize("name", cases(ENDURED))
def test_it_is_told_and_the_way_is_found_again(streams, name):
    outcome = tried(CASES[name], streams)
    assert said(outcome, ENDURED[name])
    assert outcome.end_m < SMALL_M
    assert outcome.outside < 0.05


@pytest.mark.parametrize("name", cases(SUFFERED))
def test_it_is_told_and_within_what_is_stated(streams, name):
    outcome = tried(CASES[name], streams)
    assert said(outcome, SUFFERED[name])
    assert outcome.outside < 0.05


@pytest.mark.parametrize("name", cases(BLIND))
def test_it_is_told(streams, name):
    outcome = tried(CASES[name], streams)
    assert said(outcome, BLIND[name])


@pytest.mark.slow
def test_a_fast_turn_does_no_harm(tmp_path):
    outcome = tried(CASES["turn"], cast(tmp_path, turning=True))
    assert outcome.worst_m < SMALL_M
    assert outcome.end_m < SMALL_M
    assert outcome.outside == 0.0
    assert not outcome.statuses


def test_every_fault_is_tested():
    assert {*HARMLESS, *ENDURED, *SUFFERED, *BLIND, "none", "turn"} == set(CASES)
