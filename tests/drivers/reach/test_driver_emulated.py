"""Driver and emulator end to end, over a pseudo-terminal and over TCP, with faults."""

import json
import socket
import threading
import time
from contextlib import contextmanager
from itertools import pairwise

import pytest

from drivers.driver import SensorState
from drivers.messages import FixQuality, GnssFix, NmeaSentence, SensorEvent
from drivers.reach.config import Config
from drivers.reach.driver import Sensor
from drivers.sim.faults import parse
from drivers.sim.reach_emulator import ReachSettings, Receiver
from drivers.sim.reach_emulator_ports import PseudoTerminal, TcpServer
from tests.drivers.reach import nmea_oracle
from tests.drivers.sources import DATUM, Eastward
from tests.drivers.switched import SwitchedPlan
from tests.waiting import PATIENCE_S, wait_for


@contextmanager
def in_thread(target, *args, **kwargs):
    """A thread that takes a stop event as its keyword `stop`."""
    stop = threading.Event()
    thread = threading.Thread(target=target, args=args, kwargs=kwargs | {"stop": stop}, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


class Setup:
    """One emulator and one driver, ready to run. The emulator's link is open from the start."""

    def __init__(self, folder, tcp=False, faults=(), **settings):
        self.recorded = []
        self.truth = folder / "truth.jsonl"
        self.settings = ReachSettings(
            **{"rate_hz": 10.0, "boot_s": 0.4, "acquire_s": 0.4, "utc_epoch_ns": time.time_ns()} | settings
        )
        link = folder / "dev" / "gnss"
        self.port = TcpServer("127.0.0.1", 0) if tcp else PseudoTerminal(link, self.settings.baud)
        self.port.open()
        self.epoch_ns = time.monotonic_ns()
        self.plan = SwitchedPlan("reach", [parse(f"reach:{fault}") for fault in faults])
        endpoint = "tcp:{}:{}".format(*self.port.address) if tcp else f"serial:{link}"
        self.sensor = Sensor("reach", Config(endpoint=endpoint, rate_hz=self.settings.rate_hz, reconnect_s=0.02))

    def emulator(self):
        receiver = Receiver(Eastward(), self.plan, self.epoch_ns, [self.port], self.settings)
        return in_thread(receiver.run, truth=self.truth)

    def driver(self):
        return in_thread(self.sensor.run, self.recorded.append)

    def solved(self):
        """Epochs so far, sent or not."""
        return len(self.truth.read_text().splitlines())

    def of(self, kind):
        return [message for message in self.recorded if isinstance(message, kind)]

    def fixes(self):
        return [fix for fix in self.of(GnssFix) if fix.quality is not FixQuality.INVALID]

    def walk_s(self, fix):
        """When the fix was taken, by its position."""
        return DATUM.enu(fix.latitude_deg, fix.longitude_deg, fix.height_m)[0]

    def lateness_s(self):
        """The longest way of a fix to the driver: a tenth of a second, and whatever a busy machine adds."""
        return max((fix.receive_ns - self.epoch_ns) / 1e9 - self.walk_s(fix) for fix in self.fixes())

    def assert_true_to_time(self):
        """Each fix has the position of its instant, and a stamp no further from it than the way of a fix."""
        for fix in self.fixes():
            assert self.walk_s(fix) == pytest.approx((fix.utc_ns - self.settings.utc_epoch_ns) / 1e9, abs=1e-3)
        self.assert_stamped_in_time()

    def assert_stamped_in_time(self):
        late_s = self.lateness_s() + 5e-3
        for fix in self.fixes():
            assert self.walk_s(fix) == pytest.approx((fix.stamp_ns - self.epoch_ns) / 1e9, abs=late_s)


@pytest.mark.parametrize("tcp", [False, True], ids=["pty", "tcp"])
def test_every_epoch_arrives_at_its_instant(tmp_path, tcp):
    setup = Setup(tmp_path, tcp)
    with setup.emulator(), setup.driver():
        wait_for(lambda: len(setup.fixes()) >= 15)
        health = setup.sensor.health()
    fixes = setup.fixes()
    assert [b.utc_ns - a.utc_ns for a, b in pairwise(fixes)] == [100_000_000] * (len(fixes) - 1)
    truth = {line["sensor_ns"]: line["host_ns"] for line in map(json.loads, setup.truth.read_text().splitlines())}
    setup.assert_true_to_time()
    for fix in fixes[1:-1]:  # the link was opened and closed in the midst of the others
        assert truth[fix.utc_ns] / 1e9 == pytest.approx(setup.epoch_ns / 1e9 + setup.walk_s(fix), abs=1e-3)
        assert fix.quality is FixQuality.RTK_FIXED
        assert (fix.satellites, fix.age_s, fix.sigma_enu_m) == (20, 1.2, (0.011, 0.012, 0.02))
        assert fix.sigma_source.startswith("gst")
        assert fix.speed_m_s == pytest.approx(1.0, abs=0.01)
    assert health.details["quality"] == "RTK fixed"
    assert abs(float(health.details["utc_minus_host_s"])) < 5
    assert health.clock is not None
    assert health.clock.steps == 0


@pytest.mark.parametrize("tcp", [False, True], ids=["pty", "tcp"])
def test_a_link_that_vanishes_is_taken_up_again(tmp_path, tcp):
    setup = Setup(tmp_path, tcp)
    with setup.emulator(), setup.driver():
        wait_for(lambda: len(setup.fixes()) >= 3)
        setup.plan.begin("reach:disconnect")
        wait_for(lambda: setup.sensor.health().state is SensorState.SEARCHING)
        solved = setup.solved()
        wait_for(lambda: setup.solved() >= solved + 6)
        count = len(setup.fixes())
        setup.plan.end()
        wait_for(lambda: len(setup.fixes()) > count)
    assert "receiving from" in setup.of(SensorEvent)[-1].text
    assert setup.sensor.health().streams[0].lost >= 5


def test_a_reboot_is_survived_without_a_false_fix(tmp_path):
    setup = Setup(tmp_path)
    with setup.emulator(), setup.driver():
        wait_for(setup.fixes)
        setup.plan.begin("reach:reboot")
        wait_for(lambda: any(fix.quality is FixQuality.INVALID for fix in setup.of(GnssFix)))
        count = len(setup.fixes())
        wait_for(lambda: len(setup.fixes()) > count + 3)
    setup.assert_true_to_time()


def test_garbage_and_damage_cost_sentences_and_never_make_false_ones(tmp_path):
    setup = Setup(tmp_path, faults=["garbage=3000", "corrupt=0.05", "duplicate=0.05", "reorder=0.05", "loss=0.05"])
    with setup.emulator(), setup.driver():
        wait_for(lambda: len(setup.fixes()) >= 25)
    for message in setup.of(NmeaSentence):
        assert nmea_oracle.valid_sentences(message.sentence.encode() + b"\r\n") == [message.sentence]
    setup.assert_true_to_time()
    utc_ns = [fix.utc_ns for fix in setup.fixes()]
    assert utc_ns == sorted(set(utc_ns))


def test_a_clock_step_becomes_an_event_and_the_stamps_stay(tmp_path):
    setup = Setup(tmp_path, tcp=True)
    with setup.emulator(), setup.driver():
        wait_for(lambda: len(setup.fixes()) >= 3)
        setup.plan.begin("reach:clock_step=2.5")
        wait_for(lambda: any("stepped by" in event.text for event in setup.of(SensorEvent)))
        count = len(setup.fixes())
        wait_for(lambda: len(setup.fixes()) > count + 10)
        health = setup.sensor.health()
    (event,) = [event for event in setup.of(SensorEvent) if "stepped" in event.text]
    assert float(event.text.split(" by ")[1].split()[0]) == pytest.approx(2.5, abs=setup.lateness_s() + 5e-3)
    assert health.clock is not None
    assert health.clock.steps == 1
    setup.assert_stamped_in_time()


def test_many_clients_get_the_same_bytes(tmp_path):
    setup = Setup(tmp_path, tcp=True, rate_hz=20.0)
    clients = [socket.create_connection(setup.port.address, PATIENCE_S) for _ in range(3)]
    with setup.emulator():
        heard = [received(client, 2000) for client in clients]
    for client in clients:
        client.close()
    assert heard[0] == heard[1] == heard[2]
    assert len(nmea_oracle.valid_sentences(heard[0])) >= 8


def received(client, count):
    data = b""
    while len(data) < count:
        data += client.recv(count - len(data))
    return data


def test_new_year_passes_without_a_gap(tmp_path):
    new_year_ns = 1_704_067_200 * 10**9  # date -u -d 2024-01-01 +%s
    setup = Setup(tmp_path, tcp=True, utc_epoch_ns=new_year_ns - 1_500_000_000)
    with setup.emulator(), setup.driver():
        wait_for(lambda: setup.fixes() and setup.fixes()[-1].utc_ns > new_year_ns + 300_000_000)
    utc_ns = [fix.utc_ns for fix in setup.fixes()]
    assert utc_ns[0] < new_year_ns
    assert {b - a for a, b in pairwise(utc_ns)} == {100_000_000}
    assert not any(fix.date_assumed for fix in setup.fixes())


def test_a_receiver_that_falls_silent_is_missed_and_found(tmp_path):
    setup = Setup(tmp_path)
    with setup.emulator(), setup.driver():
        wait_for(lambda: len(setup.fixes()) >= 3)
        setup.plan.begin("reach:stall")
        solved, seen = setup.solved(), []
        wait_for(lambda: seen.append(setup.sensor.health()) or "no epoch for" in seen[-1].problem)
        assert seen[-1].state is SensorState.DEGRADED
        wait_for(lambda: setup.solved() >= solved + 10)
        count = len(setup.fixes())
        setup.plan.end()
        wait_for(lambda: len(setup.fixes()) > count)
        wait_for(lambda: setup.sensor.health().state is SensorState.OK)
    assert setup.sensor.health().streams[0].lost >= 9
