"""As many images as asked, as the processor's share allows, and fewer in the heat."""

from __future__ import annotations

import pytest

from edge.live.pace import LEAST_EASE, THROTTLED_EASE, Pace

S = 1_000_000_000
FRAME_NS = 33_366_667


def run(pace: Pace, cost_s: float, seconds: float = 60.0) -> tuple[int, float]:
    """Frames come at 30 Hz, each look takes cost_s: images looked at, and their share of a core."""
    looked, busy_until = 0, 0
    for at in range(0, int(seconds * S), FRAME_NS):
        if at >= busy_until and pace.due(at):
            looked += 1
            busy_until = at + int(cost_s * S)
            pace.looked(at, cost_s)
    return looked, looked * cost_s / seconds


def test_a_quick_model_is_asked_at_the_rate_and_no_faster():
    looked, _ = run(Pace(2.0, 0.5, 85.0), 0.02)
    assert 112 <= looked <= 120


@pytest.mark.parametrize("cost_s", [0.4, 1.0, 3.0])
def test_a_slow_one_takes_no_more_than_its_share_of_a_core(cost_s):
    pace = Pace(2.0, 0.5, 85.0)
    _, share = run(pace, cost_s)
    assert 0.4 < share <= 0.5 + cost_s / 60
    assert f"takes {cost_s:.2f} s of a core" in pace.note


def test_the_pace_follows_the_cost():
    pace = Pace(2.0, 0.5, 85.0)
    run(pace, 3.0)
    assert pace.rate_hz < 0.2
    for _ in range(30):
        pace.looked(0, 0.01)
    assert pace.rate_hz == 2.0
    assert pace.note == ""


@pytest.mark.parametrize(
    ("celsius", "share"), [(None, 1.0), (60.0, 1.0), (75.0, 1.0), (80.0, 0.5), (85.0, LEAST_EASE), (99.0, LEAST_EASE)]
)
def test_heat_slows_it_down_little_by_little(celsius, share):
    pace = Pace(2.0, 0.5, 85.0)
    pace.feel(celsius, throttled=False)
    assert pace.rate_hz == pytest.approx(2.0 * share)
    assert (pace.note == "") == (share == 1.0)
    pace.feel(20.0, throttled=False)
    assert pace.rate_hz == 2.0


def test_a_throttled_computer_is_spared():
    pace = Pace(2.0, 0.5, 85.0)
    pace.feel(60.0, throttled=True)
    assert pace.rate_hz == 2.0 * THROTTLED_EASE
    assert pace.note == "the computer is throttled: 0.5 images/s"
    pace.feel(90.0, throttled=True)
    assert pace.rate_hz == 2.0 * LEAST_EASE
