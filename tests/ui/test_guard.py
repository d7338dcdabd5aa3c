"""The one key and its guard."""

from hypothesis import given
from hypothesis import strategies as st

from ui.guard import BOUNCE_S, CONFIRM_S, REST_S, Press, StopGuard


def test_the_key_starts_at_once():
    assert StopGuard().press(0.0, "idle") is Press.START


def test_a_stop_takes_the_key_twice():
    guard = StopGuard()
    assert guard.press(0.0, "recording") is Press.ARM
    assert guard.armed_for_s(1.0) == CONFIRM_S - 1.0
    assert guard.press(1.0, "recording") is Press.STOP
    assert guard.armed_for_s(1.0) == 0


def test_the_second_press_comes_too_late():
    guard = StopGuard()
    guard.press(0.0, "recording")
    assert guard.press(CONFIRM_S, "recording") is Press.ARM


def test_a_bounce_is_one_press():
    guard = StopGuard()
    guard.press(0.0, "recording")
    assert guard.press(BOUNCE_S / 2, "recording") is Press.NOTHING
    assert guard.press(BOUNCE_S, "recording") is Press.NOTHING  # still bouncing: it counts from the last one
    assert guard.press(3 * BOUNCE_S, "recording") is Press.STOP


def test_a_third_press_does_not_start_again():
    guard = StopGuard()
    guard.press(0.0, "recording")
    guard.press(1.0, "recording")
    assert guard.press(2.0, "idle") is Press.REST
    assert guard.press(1.0 + REST_S, "idle") is Press.START


def test_escape_takes_the_first_press_back():
    guard = StopGuard()
    guard.press(0.0, "recording")
    guard.disarm()
    assert guard.press(1.0, "recording") is Press.ARM


def test_nothing_happens_while_stopping():
    assert StopGuard().press(0.0, "stopping") is Press.NOTHING


@given(st.floats(0.02, BOUNCE_S * 0.9), st.integers(2, 200))
def test_a_held_key_never_stops_by_its_repeats(period_s, repeats):
    guard = StopGuard()
    presses = [guard.press(n * period_s, "recording") for n in range(repeats)]
    assert presses == [Press.ARM] + [Press.NOTHING] * (repeats - 1)
