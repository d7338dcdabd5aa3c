"""A sensor dies, or starts anew, while a session is recorded: the others go on, and it is picked up again."""

import numpy as np
import pytest

from drivers.sim.payload import Payload
from tests.reliability.chain import SENSORS, Chain, payload_config
from tests.reliability.session import Session
from tests.waiting import wait_for

pytestmark = [pytest.mark.slow, pytest.mark.timeout(400)]
TOPIC = {"livox": "/livox/imu", "reach": "/gnss/fix", "gopro": "/camera/video"}


def largest_gap_s(session: Session, sensor: str) -> float:
    return float(np.diff(session.log_s(TOPIC[sensor])).max())


def go_and_come_back(chain: Chain, name: str) -> str:
    """Until the health is red, the others have gone on, and the sensor delivers again; what was said."""
    others = [other for other in SENSORS if other != name]
    wait_for(lambda: chain.state(name) not in {"ok", ""})
    wait_for(lambda: chain.state(name) in {"searching", "failed"})
    sensor = chain.sensor(name)
    assert sensor is not None
    said = f"{sensor.name} {sensor.state}: {sensor.problem}. {sensor.advice}"
    chain.until_more(10, *others)
    return said


@pytest.mark.parametrize("name", SENSORS)
def test_a_killed_sensor_is_told_and_picked_up_again(tmp_path, figures, name):
    with Chain(tmp_path) as chain:
        chain.until_delivering()
        folder = chain.start()
        chain.until_more(10)
        chain.kill_emulator(name)
        said = go_and_come_back(chain, name)
        assert chain.status is not None
        assert chain.status.state == "recording"
        chain.start_emulator(name, uptime_s=0.0)
        chain.until_more(20, name)
        wait_for(lambda: chain.state(name) in {"ok", "degraded"})
        chain.stop()
        verdict, reasons = chain.until_verdict()
    session = Session(folder)
    gap_s = largest_gap_s(session, name)
    others = {other: round(largest_gap_s(session, other), 2) for other in SENSORS if other != name}
    figures(f"{gap_s:.1f} s of {name}, gaps of the others {others}; {verdict}", [said, *reasons])
    assert session.record["dropped"] == {}
    assert gap_s > 2.0
    assert session.doubled == []
    for topic in TOPIC.values():
        assert (np.diff(session.stamps_ns(topic)) > 0).all(), topic


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_that_reboots_is_told_and_goes_on(tmp_path, figures, name):
    with Chain(tmp_path) as chain:
        chain.until_delivering()
        folder = chain.start()
        chain.until_more(10)
        chain.fault(name, "reboot")
        if name == "livox":  # started anew ten times as fast as the real one: the gap is about a second
            wait_for(lambda: chain.truth(name).get("reboots") == 1)
        else:
            wait_for(lambda: chain.state(name) not in {"ok", "degraded"})
        chain.until_more(20, name)
        wait_for(lambda: chain.state(name) in {"ok", "degraded"})
        chain.until_more(10)
        chain.stop()
        verdict, reasons = chain.until_verdict()
    session = Session(folder)
    events = [event.text for event in session.events if event.name == name]
    figures(f"{largest_gap_s(session, name):.1f} s of {name}; {verdict}", [*chain.told, *reasons, "events:", *events])
    assert events
    assert session.record["dropped"] == {}
    assert session.doubled == []
    for topic in TOPIC.values():
        assert (np.diff(session.stamps_ns(topic)) > 0).all(), topic
        apart_s = np.abs(session.log_s(topic) - session.stamps_ns(topic) / 1e9)
        assert apart_s.max() < 2.0, topic
    if name == "livox":
        assert any("started anew" in text for text in events)


def test_each_sensor_of_the_whole_payload_is_killed_in_turn(tmp_path, figures):
    """The emulated payload of the demonstration, forest and all."""
    with Payload(payload_config()) as payload, Chain(tmp_path, payload=payload.config) as chain:
        chain.until_delivering()
        folder = chain.start()
        said = []
        for name in SENSORS:
            chain.until_more(10)
            payload.processes[name].kill()
            said.append(go_and_come_back(chain, name))
            payload.restart(name)
            chain.until_more(20, name)
        chain.stop()
        verdict, reasons = chain.until_verdict()
    session = Session(folder)
    figures(f"{ {name: round(largest_gap_s(session, name), 1) for name in SENSORS} } s; {verdict}", [*said, *reasons])
    assert session.record["dropped"] == {}
    for topic in TOPIC.values():
        assert (np.diff(session.stamps_ns(topic)) > 0).all(), topic
