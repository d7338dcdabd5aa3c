"""The driver over a real pseudo-terminal and real TCP, fed with real logs and by hand."""

import math
import os
import socket
import threading
import tty
from contextlib import contextmanager

import msgspec
import pytest

from drivers.driver import SensorState
from drivers.errors import SensorUnreachable
from drivers.messages import FixQuality, GnssFix, NmeaSentence, SensorEvent, Severity
from drivers.reach import health, transport
from drivers.reach.config import Config, SerialEndpoint, TcpEndpoint, parse_endpoint
from drivers.reach.driver import Sensor
from tests.drivers.reach import nmea_oracle
from tests.waiting import PATIENCE_S, wait_for


class Recorded(list):
    """What a driver emitted."""

    def of(self, kind):
        return [message for message in self if isinstance(message, kind)]


@contextmanager
def running(**config):
    sensor = Sensor("reach", Config(**{"reconnect_s": 0.02} | config))
    recorded, stop = Recorded(), threading.Event()
    thread = threading.Thread(target=sensor.run, args=(recorded.append, stop), daemon=True)
    thread.start()
    try:
        yield sensor, recorded
    finally:
        stop.set()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


@contextmanager
def pseudo_terminal():
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        yield master, os.ttyname(slave)
    finally:
        os.close(master)
        os.close(slave)


def opened(sensor):
    wait_for(lambda: sensor.health().state is not SensorState.SEARCHING)


def write_in_odd_chunks(descriptor, data):
    """Sizes from 1 to 257, as no sentence is."""
    at, size = 0, 1
    while at < len(data):
        at += os.write(descriptor, data[at : at + size])
        size = size * 7 % 257 + 1


@pytest.mark.parametrize("name", ["ublox-zed-f9r.log", "nmea-rtk.log", "ublox-zed-f9p-nmea.log", "quectel-L70.log"])
def test_a_real_log_through_a_pseudo_terminal_is_recorded_whole(name):
    path = nmea_oracle.LOGS / name
    if not path.exists():
        pytest.skip(f"{path} is not here")
    data = path.read_bytes()
    sentences = nmea_oracle.valid_sentences(data)
    expected = list({gga[0]: gga for gga in reversed(nmea_oracle.ggas(sentences))}.values())[::-1]
    # A period of 10 s: epochs close when the time changes, however slow this machine is just now.
    with pseudo_terminal() as (master, device):
        with running(endpoint=f"serial:{device}", rate_hz=0.1) as (sensor, recorded):
            opened(sensor)
            write_in_odd_chunks(master, data + b"\r\n")
            wait_for(lambda: len(recorded.of(NmeaSentence)) >= len(sentences))
        fixes = recorded.of(GnssFix)
    assert [message.sentence for message in recorded.of(NmeaSentence)] == sentences
    assert [fix.quality for fix in fixes] == [quality for _, quality, _, _ in expected]
    for fix, (clock, _, latitude, longitude) in zip(fixes, expected, strict=True):
        assert fix.latitude_deg == pytest.approx(latitude, abs=1e-12)
        assert fix.longitude_deg == pytest.approx(longitude, abs=1e-12)
        seconds = int(clock[:2]) * 3600 + int(clock[2:4]) * 60 + float(clock[4:])
        assert fix.utc_ns % (86400 * 10**9) / 1e9 == pytest.approx(seconds, abs=1e-6)
        assert not fix.date_assumed
        assert min(fix.sigma_enu_m) > 0


def test_a_device_that_is_not_there_is_searched_for_and_found(tmp_path):
    link = tmp_path / "gnss"
    with running(endpoint=f"serial:{link}") as (sensor, recorded):
        wait_for(lambda: "does not exist" in sensor.health().problem)
        found = sensor.health()
        assert found.state is SensorState.SEARCHING
        assert "plug the Reach in" in found.advice
        for _ in range(2):  # plugged in, taken away, plugged in again
            with pseudo_terminal() as (master, device):
                link.symlink_to(device)
                opened(sensor)
                count = len(recorded.of(NmeaSentence))
                os.write(master, nmea_oracle.sentence("GNGGA,,,,,,,,,,,,,,").encode() + b"\r\n")
                wait_for(lambda before=count: len(recorded.of(NmeaSentence)) > before)
                link.unlink()
            wait_for(lambda: sensor.health().state is SensorState.SEARCHING)
    texts = [(event.severity, event.text) for event in recorded.of(SensorEvent)]
    assert [severity for severity, _ in texts[:4]] == [Severity.INFO, Severity.WARNING] * 2
    assert "is gone" in texts[1][1]


def test_bytes_from_before_the_opening_are_thrown_away():
    old, new = (nmea_oracle.sentence(f"GNZDA,12000{k}.00,30,08,2023,00,00") for k in (0, 1))
    with pseudo_terminal() as (master, device):
        os.write(master, f"{old}\r\n".encode())
        with running(endpoint=f"serial:{device}") as (sensor, recorded):
            opened(sensor)
            os.write(master, f"{new}\r\n".encode())
            wait_for(lambda: recorded.of(NmeaSentence))
    assert [message.sentence for message in recorded.of(NmeaSentence)] == [new]


def test_a_device_in_use_is_said_to_be():
    with pseudo_terminal() as (_, device), running(endpoint=f"serial:{device}") as (first, _):
        opened(first)
        with running(endpoint=f"serial:{device}") as (second, _):
            wait_for(lambda: "in use by another program" in second.health().problem)


def test_a_tcp_server_that_closes_is_dialled_again():
    gga = nmea_oracle.sentence("GNGGA,231938.60,5330.0158984,N,00216.5258340,W,4,16,0.7,52.140,M,51.454,M,1.4,")
    with socket.create_server(("127.0.31.7", 0)) as server:
        port = server.getsockname()[1]
        with running(endpoint=f"tcp:127.0.31.7:{port}") as (sensor, recorded):
            for _ in range(2):
                client, _ = server.accept()
                with client:
                    client.sendall(gga[:30].encode())
                    client.sendall(gga[30:].encode() + b"\r\n")
                    count = len(recorded.of(GnssFix))
                    wait_for(
                        lambda before=count: len(recorded.of(GnssFix)) > before or sensor.health().streams[0].received
                    )
            wait_for(lambda: len(recorded.of(NmeaSentence)) == 2)
    fix = recorded.of(GnssFix)[0]
    assert fix.quality is FixQuality.RTK_FIXED
    assert fix.date_assumed
    assert fix.age_s == 1.4
    assert fix.height_m == pytest.approx(103.594)
    assert fix.sigma_source == "quality table x hdop"
    assert any("closed the connection" in event.text for event in recorded.of(SensorEvent))


def test_a_silent_tcp_link_is_opened_anew():
    with socket.create_server(("127.0.31.8", 0)) as server:
        port = server.getsockname()[1]
        with running(endpoint=f"tcp:127.0.31.8:{port}", silence_s=0.3):
            first, _ = server.accept()
            server.settimeout(PATIENCE_S)
            second, _ = server.accept()
            first.close()
            second.close()


def test_no_fix_without_time_is_recorded_and_said():
    burst = b"".join(
        nmea_oracle.sentence(body).encode() + b"\r\n"
        for body in ("GPRMC,,,,,,,,,,,,", "GPGGA,,,,,,,,,,,,,,", "GNGST,,,,,,,,", "GNZDA,,,,,,", "GNEBP,,,,,,M")
    )
    with pseudo_terminal() as (master, device), running(endpoint=f"serial:{device}") as (sensor, recorded):
        opened(sensor)
        os.write(master, burst)
        wait_for(lambda: recorded.of(GnssFix))
        found = sensor.health()
    (fix,) = recorded.of(GnssFix)
    assert fix.quality is FixQuality.INVALID
    assert fix.utc_ns == 0
    assert fix.stamp_ns == fix.receive_ns
    assert all(math.isnan(x) for x in (fix.latitude_deg, fix.longitude_deg, fix.height_m, *fix.sigma_enu_m))
    assert found.state is SensorState.DEGRADED
    assert "no fix" in found.problem
    assert found.clock is None


def test_bytes_that_are_no_nmea_are_said_to_be(monkeypatch):
    monkeypatch.setattr(health, "FIRST_SENTENCE_S", 0.1)
    with pseudo_terminal() as (master, device), running(endpoint=f"serial:{device}") as (sensor, recorded):
        opened(sensor)
        os.write(master, b"\xb5\x62\x01\x07" * 20)
        wait_for(lambda: "no NMEA sentence among them" in sensor.health().problem)
        assert "baud" in sensor.health().advice
    assert not recorded.of(NmeaSentence)


def test_a_host_that_does_not_answer_is_given_up_at_once_when_asked_to_stop(monkeypatch):
    dialling, dial = threading.Event(), transport._dial
    monkeypatch.setattr(transport, "CONNECT_TIMEOUT_S", math.inf)
    monkeypatch.setattr(transport, "_dial", lambda *args: (dialling.set(), dial(*args))[1])
    with socket.socket() as deaf:
        deaf.bind(("127.0.31.9", 0))
        deaf.listen(0)
        address = deaf.getsockname()
        waiting = []
        for _ in range(3):  # fill the backlog: further attempts are left without an answer
            client = socket.socket()
            client.setblocking(False)
            client.connect_ex(address)
            waiting.append(client)
        sensor, stop = Sensor("reach", Config(endpoint=f"tcp:{address[0]}:{address[1]}")), threading.Event()
        thread = threading.Thread(target=sensor.run, args=(Recorded().append, stop), daemon=True)
        thread.start()
        assert dialling.wait(PATIENCE_S)
        assert sensor.health().state is SensorState.SEARCHING
        stop.set()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()
        for client in waiting:
            client.close()


@pytest.mark.parametrize("endpoint", ["usb", "serial:gnss", "tcp:", "tcp:host:0", "tcp::9001", "tcp:h:99999", ""])
def test_an_endpoint_that_makes_no_sense_is_refused_with_an_example(endpoint):
    with pytest.raises(msgspec.ValidationError, match=r"tcp:192\.168\.2\.15:9001"):
        msgspec.convert({"endpoint": endpoint}, Config)


def test_a_tcp_port_may_be_left_out():
    assert parse_endpoint("tcp:reach.local") == TcpEndpoint("reach.local", 9001)
    assert parse_endpoint("serial:auto") == SerialEndpoint("")


def test_the_stable_name_is_taken_before_any_other_and_then_the_usb_product(monkeypatch):
    class Port:
        vid, pid, device = 0x3032, 0x0013, "/dev/ttyACM7"

    names = {"/dev/mapforest/gnss": [], "/dev/serial/by-id/*[Rr]each*": ["/dev/serial/by-id/usb-Emlid_Reach-if02"]}
    monkeypatch.setattr(transport.glob, "glob", lambda pattern: names.get(pattern, []))
    monkeypatch.setattr(transport.list_ports, "comports", lambda: [Port()])
    assert transport.find_device() == "/dev/serial/by-id/usb-Emlid_Reach-if02"
    names["/dev/mapforest/gnss"] = ["/dev/mapforest/gnss"]
    assert transport.find_device() == "/dev/mapforest/gnss"
    names.clear()
    assert transport.find_device() == "/dev/ttyACM7"
    Port.pid = 0x0014
    with pytest.raises(SensorUnreachable, match="data cable"):
        transport.find_device()


@pytest.mark.parametrize("endpoint", ["serial:/dev/null", "tcp:" + "a" * 70, "tcp:127.0.31.10:9"])
def test_what_cannot_be_opened_is_searched_for_and_never_raises(endpoint):
    with running(endpoint=endpoint) as (sensor, _):
        wait_for(lambda: "looking for" not in sensor.health().problem)
        found = sensor.health()
    assert found.state is SensorState.SEARCHING
    assert found.problem
    assert found.advice
