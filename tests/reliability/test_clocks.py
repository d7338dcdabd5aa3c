"""Clocks that step: the computer's and each sensor's. Session time goes on, and the file says what happened."""

import numpy as np
import pytest

from tests.reliability.chain import SENSORS, Chain
from tests.reliability.session import Session
from tests.waiting import wait_for

pytestmark = pytest.mark.slow
TOPICS = ("/livox/lidar", "/livox/imu", "/gnss/fix", "/camera/video", "/diagnostics")


def goes_on(session: Session) -> None:
    """No stamp jumps: neither back, nor away from the time of its reception."""
    for topic in TOPICS:
        assert (np.diff(session.log_s(topic)) >= 0).all(), topic
        assert (np.diff(session.stamps_ns(topic)) > 0).all(), topic
        apart_s = session.log_s(topic) - session.stamps_ns(topic) / 1e9
        assert np.abs(apart_s).max() < 1.5, topic


@pytest.mark.parametrize("step_s", [3600.0, -2.5])
def test_a_step_of_the_computers_clock_is_recorded_and_moves_no_stamp(tmp_path, figures, step_s):
    with Chain(tmp_path, faulty=True) as chain:
        chain.until_delivering()
        folder = chain.start()
        chain.until_more(20)
        (tmp_path / "step").write_text(str(round(step_s * 1e9)))
        words = chain.until_told("the system clock stepped")
        chain.until_more(30)
        chain.stop()
        verdict, reasons = chain.until_verdict()
    session = Session(folder)
    (event,) = session.told("system clock stepped")
    figures(f"nothing; {verdict} {reasons}", [words, f"event: {event}"])
    goes_on(session)
    assert event.startswith(f"system clock stepped by {step_s:+.0f}"[:30])
    assert session.record["clock"]["steps"] == 1
    assert session.record["duration_s"] < 1000


@pytest.mark.parametrize("step_s", [7.5, -3.0])
def test_a_step_of_a_sensors_clock_is_recorded_and_moves_no_stamp(tmp_path, figures, step_s):
    with Chain(tmp_path) as chain:
        chain.until_delivering()
        folder = chain.start()
        chain.until_more(20)
        for name in SENSORS:
            chain.fault(name, f"clock_step={step_s}")
        for name in SENSORS:
            wait_for(lambda name=name: stepped(chain, name))
        chain.until_more(30)
        chain.stop()
        verdict, reasons = chain.until_verdict()
    session = Session(folder)
    events = [f"event of {event.name}: {event.text}" for event in session.events if event.name in SENSORS]
    figures(f"nothing; {verdict} {reasons}", [*chain.told, *events])
    goes_on(session)
    for name in SENSORS:
        assert any(event.name == name for event in session.events), name


def stepped(chain: Chain, name: str) -> bool:
    sensor = chain.sensor(name)
    return sensor is not None and sensor.clock is not None and sensor.clock.steps > 0
