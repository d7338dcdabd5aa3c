import threading

import pytest

from drivers.driver import SensorHealth, SensorState, StreamHealth
from edge.calibration.units import Units
from edge.config import Config, Recording
from edge.control.messages import Host, Sensor, Status, Stream
from edge.preflight import calibration, disk, host, sensors
from edge.preflight.check import Outcome
from edge.preflight.disk import WriteSpeed


def outcomes(checks):
    return {check.subject: check.outcome for check in checks}


def test_every_finding_that_is_not_good_comes_with_advice(tmp_path):
    config = Config(recording=Recording(folder=str(tmp_path), require_mount=True), calibration="/nowhere/calib.toml")
    checks = [
        *disk.check_disk(config.recording),
        *calibration.check_calibration(config, Units()),
        host.check_clock(0.0, False, ""),
    ]
    assert Outcome.BAD in outcomes(checks).values()
    assert all(check.advice for check in checks if check.outcome is not Outcome.GOOD)


def test_a_folder_that_cannot_be_written_is_bad():
    (check,) = disk.check_disk(Recording(folder="/proc/mapforest"))
    assert check.outcome is Outcome.BAD
    assert "/proc/mapforest" in check.found


def test_the_probe_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.setattr(disk, "PROBE_BLOCKS", 2)
    assert disk.probe(tmp_path).mib_s > 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("speed", "outcome"),
    [
        (WriteSpeed(60.0, 0.1), Outcome.GOOD),
        (WriteSpeed(60.0, 3.0), Outcome.WARNING),
        (WriteSpeed(6.0, 0.7), Outcome.BAD),
    ],
)
def test_a_card_is_judged_by_rate_and_by_its_longest_pause(tmp_path, monkeypatch, speed, outcome):
    monkeypatch.setattr(disk, "probe", lambda folder: speed)
    checks = disk.check_disk(Recording(folder=str(tmp_path), min_free_mib=1, min_free_percent=0.0))
    assert outcomes(checks)["card speed"] is outcome


def test_small_socket_buffers_are_told(tmp_path):
    setting = tmp_path / "sys/net/core/rmem_max"
    setting.parent.mkdir(parents=True)
    setting.write_text("212992\n")
    assert host.check_kernel(tmp_path).outcome is Outcome.WARNING
    setting.write_text("16777216\n")
    assert host.check_kernel(tmp_path).outcome is Outcome.GOOD


def test_sensors_of_a_running_recorder_are_taken_from_its_status():
    stream = Stream("points", 10.0, 10.0, 100, 0, 0.1)
    present = Sensor("livox", "ok", (stream,))
    absent = Sensor("gopro", "searching", problem="nobody answers", advice="switch it on")
    idle = Host(1.0, 1.0, None, False, 1, None, None, 0.0, True, "ntp")
    checks = sensors.check_running(Status(0, "idle", (present, absent), idle))
    assert outcomes(checks) == {"sensor livox": Outcome.GOOD, "sensor gopro": Outcome.BAD}
    assert "points 10/s" in checks[0].found
    assert checks[1].advice == "switch it on"


class Present:
    """A sensor that delivers from the third look on."""

    name = "livox"

    def __init__(self):
        self.looks = 0
        self.stopped = threading.Event()

    def run(self, emit, stop):
        stop.wait()
        self.stopped.set()

    def health(self):
        self.looks += 1
        state = SensorState.OK if self.looks >= 2 else SensorState.STARTING
        return SensorHealth(self.name, state, (StreamHealth("points", 10.0, 10.0, 20, 0, 0.1),))


def test_without_a_recorder_the_sensors_are_listened_to_and_left_alone_again(monkeypatch):
    driver = Present()
    monkeypatch.setattr(sensors, "_build", lambda config, name: driver)
    (check,) = sensors.check_heard(sensors.listen(Config(sensors={"livox": {}}), listen_s=10.0))
    assert check.outcome is Outcome.GOOD
    assert driver.stopped.is_set()
