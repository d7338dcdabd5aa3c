"""Driver and emulator end to end, over a pseudo-terminal and over TCP, with faults."""

import json
import random
import socket
import time
from itertools import pairwise

import pytest

from drivers.driver import SensorState
from drivers.messages import FixQuality, GnssFix, NmeaSentence, SensorEvent
from drivers.reach.config import Config
from drivers.reach.driver import Sensor
from drivers.sim import reach_emulator
from drivers.sim.reach_emulator import ReachSettings
from tests.drivers.reach import emulated, nmea_oracle
from tests.waiting import wait_for


class Setup:
    """One emulator and one driver, ready to run."""

    def __init__(self, folder, tcp=False, faults=(), **settings):
        self.recorded = []
        self.truth = folder / "truth.jsonl"
        link = folder / "dev" / "gnss"
        address = f"127.{random.randint(1, 250)}.{random.randint(1, 250)}.{random.randint(1, 250)}"
        with socket.create_server((address, 0)) as free:
            port = free.getsockname()[1]
        self.link = None if tcp else link
        self.address = (address, port) if tcp else None
        self.epoch_ns = time.monotonic_ns()
        self.plan = emulated.plan(*faults)
        self.settings = ReachSettings(**{"rate_hz": 10.0, "boot_s": 0.4, "acquire_s": 0.4} | settings)
        endpoint = f"tcp:{address}:{port}" if tcp else f"serial:{link}"
        self.sensor = Sensor("reach", Config(endpoint=endpoint, rate_hz=self.settings.rate_hz, reconnect_s=0.02))

    def emulator(self):
        return emulated.in_thread(
            reach_emulator.run,
            emulated.Circle(),
            self.plan,
            self.epoch_ns,
            pty=self.link,
            tcp=self.address,
            settings=self.settings,
            truth=self.truth,
        )

    def driver(self):
        return emulated.in_thread(self.sensor.run, self.recorded.append)

    def of(self, kind):
        return [message for message in self.recorded if isinstance(message, kind)]

    def fixes(self):
        return [fix for fix in self.of(GnssFix) if fix.quality is not FixQuality.INVALID]

    def walk_s(self, fix):
        """When the fix was taken, by its position."""
        return emulated.DATUM.enu(fix.latitude_deg, fix.longitude_deg, fix.height_m)[0]


@pytest.mark.parametrize("tcp", [False, True], ids=["pty", "tcp"])
def test_every_epoch_arrives_at_its_instant(tmp_path, tcp):
    setup = Setup(tmp_path, tcp)
    with setup.emulator(), setup.driver():
        wait_for(lambda: len(setup.fixes()) >= 15)
        health = setup.sensor.health()
    fixes = setup.fixes()
    assert [b.utc_ns - a.utc_ns for a, b in pairwise(fixes)] == [100_000_000] * (len(fixes) - 1)
    truth = {line["sensor_ns"]: line["host_ns"] for line in map(json.loads, setup.truth.read_text().splitlines())}
    for fix in fixes[1:-1]:  # the link was opened and closed in the midst of the others
        assert truth[fix.utc_ns] / 1e9 == pytest.approx(setup.epoch_ns / 1e9 + setup.walk_s(fix), abs=1e-3)
        assert 0 <= fix.stamp_ns - truth[fix.utc_ns] < 1_000_000_000
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
    setup = Setup(tmp_path, tcp, ["disconnect@1+0.7"])
    with setup.emulator(), setup.driver():
        wait_for(setup.fixes)
        wait_for(lambda: setup.sensor.health().state is SensorState.SEARCHING)
        lost_s = max(map(setup.walk_s, setup.fixes()))
        wait_for(lambda: setup.walk_s(setup.fixes()[-1]) > lost_s + 1.0)
    assert "receiving from" in setup.of(SensorEvent)[-1].text
    assert setup.sensor.health().streams[0].lost >= 5


def test_a_reboot_is_survived_without_a_false_fix(tmp_path):
    setup = Setup(tmp_path, faults=["reboot@1"])
    with setup.emulator(), setup.driver():
        wait_for(lambda: any(fix.quality is FixQuality.INVALID for fix in setup.of(GnssFix)))
        count = len(setup.fixes())
        wait_for(lambda: len(setup.fixes()) > count + 3)
    for fix in setup.fixes():
        assert setup.walk_s(fix) == pytest.approx((fix.stamp_ns - setup.epoch_ns) / 1e9, abs=1.0)


def test_garbage_and_damage_cost_sentences_and_never_make_false_ones(tmp_path):
    setup = Setup(tmp_path, faults=["garbage=3000", "corrupt=0.05", "duplicate=0.05", "reorder=0.05", "loss=0.05"])
    with setup.emulator(), setup.driver():
        wait_for(lambda: len(setup.fixes()) >= 25)
    for message in setup.of(NmeaSentence):
        assert nmea_oracle.valid_sentences(message.sentence.encode() + b"\r\n") == [message.sentence]
    for fix in setup.fixes():
        assert setup.walk_s(fix) == pytest.approx((fix.stamp_ns - setup.epoch_ns) / 1e9, abs=1.0)
    utc_ns = [fix.utc_ns for fix in setup.fixes()]
    assert utc_ns == sorted(set(utc_ns))


def test_a_clock_step_becomes_an_event_and_the_stamps_stay(tmp_path):
    setup = Setup(tmp_path, tcp=True, faults=["clock_step=2.5@1"])
    with setup.emulator(), setup.driver():
        wait_for(lambda: any("stepped by" in event.text for event in setup.of(SensorEvent)))
        count = len(setup.fixes())
        wait_for(lambda: len(setup.fixes()) > count + 10)
        health = setup.sensor.health()
    (event,) = [event for event in setup.of(SensorEvent) if "stepped" in event.text]
    assert float(event.text.split(" by ")[1].split()[0]) == pytest.approx(2.5, abs=0.4)
    assert health.clock is not None
    assert health.clock.steps == 1
    for fix in setup.fixes():
        assert setup.walk_s(fix) == pytest.approx((fix.stamp_ns - setup.epoch_ns) / 1e9, abs=1.0)


def test_many_clients_get_the_same_bytes(tmp_path):
    setup = Setup(tmp_path, tcp=True)
    with setup.emulator():
        wait_for(setup.truth.exists)
        clients = [socket.create_connection(setup.address, 5.0) for _ in range(3)]
        heard = [b"".join(client.recv(4096) for _ in range(8)) for client in clients]
        for client in clients:
            client.close()
    texts = [nmea_oracle.valid_sentences(data) for data in heard]
    assert len(texts[0]) >= 8
    assert len(set(texts[0]) & set(texts[1]) & set(texts[2])) >= 8


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
    setup = Setup(tmp_path, faults=["stall@1+1.2"])
    with setup.emulator(), setup.driver():
        seen = []
        wait_for(lambda: seen.append(setup.sensor.health()) or "no epoch for" in seen[-1].problem)
        assert seen[-1].state is SensorState.DEGRADED
        count = len(setup.fixes())
        wait_for(lambda: len(setup.fixes()) > count)
        wait_for(lambda: setup.sensor.health().state is SensorState.OK)
    assert setup.sensor.health().streams[0].lost >= 9
