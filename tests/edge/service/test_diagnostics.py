"""What goes into the file about the recorder itself, and what clients see of the drivers' words."""

import math

from drivers.clock import ClockState
from drivers.driver import SensorHealth, SensorState, StreamHealth
from drivers.messages import QUALITY_NAMES, FixQuality
from edge.control.codec import decode, encode
from edge.control.messages import Detecting, Status
from edge.recording.account import RecordingStatus, TopicDrops
from edge.recording.messages import DiagnosticStatus, Level
from edge.service.diagnostics import SystemClock, diagnostics
from edge.service.host import HostSample
from edge.service.host_clock import Discipline
from edge.service.states import sensor_state
from tests.edge.service.test_control_server import HOST

HEALTH = SensorHealth(
    "livox",
    SensorState.DEGRADED,
    (StreamHealth("points", 9.5, 10.0, 95, 3, 0.31),),
    ClockState(123, -4.5, 20_000.0, 90_000.0, 1, "PTP"),
    "3 packets lost",
    "check the cable",
    61.5,
    None,
    {"serial": "47MDL"},
)
SAMPLE = HostSample(50.0, 30.0, 70.0, True, "cpufreq-cpu0", None)
RECORDING = RecordingStatus(
    session="s",
    folder="/f",
    elapsed_s=10.0,
    bytes_written=1000,
    messages=100,
    dropped={"/livox/lidar": TopicDrops(4, 1, 2)},
    queue_fill=0.5,
    flush_ms=3.0,
    flush_worst_ms=80.0,
    split=0,
    marks=0,
    last_progress_ns=900,
    disk_free_bytes=5,
)


def by_name() -> dict[str, DiagnosticStatus]:
    clock = SystemClock(77, 2, Discipline(False, "none", 16.0))
    return {status.name: status for status in diagnostics(1000, (HEALTH,), SAMPLE, clock, RECORDING).statuses}


def test_each_part_has_its_level_and_its_figures() -> None:
    told = by_name()
    assert {name: status.level for name, status in told.items()} == {
        "sensor/livox": Level.WARN,
        "host": Level.WARN,
        "host/clock": Level.WARN,
        "recorder": Level.WARN,
    }
    livox = dict(told["sensor/livox"].values)
    assert (livox["points.lost"], livox["clock.steps"], livox["temperature_c"]) == ("3", "1", "61.5")
    assert told["sensor/livox"].hardware_id == "47MDL"
    assert told["host"].message == "slowed down by cpufreq-cpu0"
    assert dict(told["host/clock"].values)["utc_minus_monotonic_ns"] == "77"
    assert dict(told["recorder"].values)["dropped./livox/lidar"] == "4"


def test_the_detector_is_in_the_file_with_the_model_it_uses() -> None:
    detecting = Detecting("failed", "ailanthus", "ab12", "cuda", 1.5, 180.0, 3, 40, 560, "out of memory")
    clock = SystemClock(77, 2, Discipline(False, ""))
    told = diagnostics(5, (HEALTH,), SAMPLE, clock, None, detecting=detecting).statuses[-1]
    assert (told.name, told.level, told.message) == ("pipeline/detection", Level.ERROR, "out of memory")
    assert dict(told.values)["sha256"] == "ab12"


def test_every_quality_has_a_name() -> None:
    assert set(QUALITY_NAMES) == set(FixQuality)


def test_a_sensor_with_odd_figures_still_travels() -> None:
    odd = SensorHealth("x", SensorState.OK, (StreamHealth("a", math.nan, 1.0, 0, 0, math.inf),), None)
    status = Status(stamp_ns=0, state="idle", sensors=(sensor_state(odd), sensor_state(HEALTH)), host=HOST)
    assert decode(encode(status)) == status
    assert status.sensors[0].streams[0].rate_hz == 0.0
