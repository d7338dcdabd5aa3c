"""The state of everything once a second, as it goes into the file: health, clocks, drops, heat, disk."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.clock import ClockState
from drivers.driver import SensorHealth, SensorState
from edge.control.messages import Detecting
from edge.recording.account import RecordingStatus
from edge.recording.messages import Diagnostics, DiagnosticStatus, Level
from edge.service.host import HostSample
from edge.service.host_clock import Discipline

_LEVELS = {
    SensorState.SEARCHING: Level.STALE,
    SensorState.STARTING: Level.WARN,
    SensorState.OK: Level.OK,
    SensorState.DEGRADED: Level.WARN,
    SensorState.FAILED: Level.ERROR,
}
Values = list[tuple[str, str]]


@dataclass(frozen=True)
class SystemClock:
    """The computer's clock: UTC minus monotonic, and the steps seen since the service started."""

    offset_ns: int
    steps: int
    discipline: Discipline


def diagnostics(
    now_ns: int,
    sensors: tuple[SensorHealth, ...],
    host: HostSample,
    clock: SystemClock,
    recording: RecordingStatus | None,
    *,
    detecting: Detecting | None = None,
) -> Diagnostics:
    """One message: a status for each sensor, the computer, its clock, the recorder and the live detector."""
    statuses = [_sensor(health) for health in sensors]
    statuses += [_host(host), _system_clock(clock)]
    if recording is not None:
        statuses.append(_recorder(recording, now_ns))
    if detecting is not None:
        statuses.append(_detector(detecting))
    return Diagnostics(now_ns, now_ns, tuple(statuses))


def _sensor(health: SensorHealth) -> DiagnosticStatus:
    values: Values = [("state", health.state.value)]
    for stream in health.streams:
        values += [
            (f"{stream.name}.rate_hz", f"{stream.rate_hz:.2f}"),
            (f"{stream.name}.expected_hz", f"{stream.expected_hz:g}"),
            (f"{stream.name}.received", str(stream.received)),
            (f"{stream.name}.units", str(stream.units or stream.received)),
            (f"{stream.name}.lost", str(stream.lost)),
            (f"{stream.name}.largest_gap_s", f"{stream.largest_gap_s:.3f}"),
        ]
    if health.clock is not None:
        values += _clock(health.clock)
    if health.temperature_c is not None:
        values.append(("temperature_c", f"{health.temperature_c:.1f}"))
    if health.battery_percent is not None:
        values.append(("battery_percent", f"{health.battery_percent:.0f}"))
    if health.advice:
        values.append(("advice", health.advice))
    values += [(key, str(value)) for key, value in health.details.items()]
    message = health.problem or health.state.value
    hardware = health.details.get("serial", "")
    return DiagnosticStatus(f"sensor/{health.name}", _LEVELS[health.state], message, hardware, tuple(values))


def _clock(clock: ClockState) -> Values:
    return [
        ("clock.updated_ns", str(clock.updated_ns)),
        ("clock.offset_ns", str(clock.offset_ns)),
        ("clock.skew_ppm", f"{clock.skew_ppm:.3f}"),
        ("clock.sigma_ns", f"{clock.sigma_ns:.0f}"),
        ("clock.jitter_ns", f"{clock.jitter_ns:.0f}"),
        ("clock.steps", str(clock.steps)),
        ("clock.synchronised", clock.synchronised),
    ]


def _host(host: HostSample) -> DiagnosticStatus:
    values: Values = [("cpu_percent", f"{host.cpu_percent:.1f}"), ("memory_percent", f"{host.memory_percent:.1f}")]
    if host.temperature_c is not None:
        values.append(("temperature_c", f"{host.temperature_c:.1f}"))
    if host.battery_remaining_s is not None:
        values.append(("battery_remaining_s", f"{host.battery_remaining_s:.0f}"))
    values.append(("throttled_by", host.throttled_by))
    message = f"slowed down by {host.throttled_by}" if host.throttled else "ok"
    return DiagnosticStatus("host", Level.WARN if host.throttled else Level.OK, message, "", tuple(values))


def _detector(detecting: Detecting) -> DiagnosticStatus:
    values: Values = [
        ("state", detecting.state),
        ("model", detecting.model),
        ("sha256", detecting.sha256),
        ("device", detecting.device),
        ("rate_hz", f"{detecting.rate_hz:.2f}"),
        ("latency_ms", f"{detecting.latency_ms:.0f}"),
        ("looked", str(detecting.looked)),
        ("passed_over", str(detecting.passed_over)),
    ]
    level = Level.ERROR if detecting.state == "failed" else Level.OK if detecting.state == "watching" else Level.WARN
    return DiagnosticStatus("pipeline/detection", level, detecting.note or detecting.state, "", tuple(values))


def _system_clock(clock: SystemClock) -> DiagnosticStatus:
    told = clock.discipline
    values: Values = [
        ("utc_minus_monotonic_ns", str(clock.offset_ns)),
        ("steps", str(clock.steps)),
        ("synchronised", str(told.synchronised).lower()),
        ("source", told.source),
    ]
    if told.error_s is not None:
        values.append(("estimated_error_s", f"{told.error_s:.6f}"))
    level, message = (Level.OK, "ok") if told.synchronised else (Level.WARN, "the system clock is not synchronised")
    return DiagnosticStatus("host/clock", level, message, "", tuple(values))


def _recorder(status: RecordingStatus, now_ns: int) -> DiagnosticStatus:
    dropped = sum(drops.count for drops in status.dropped.values())
    values: Values = [
        ("session", status.session),
        ("split", str(status.split)),
        ("bytes_written", str(status.bytes_written)),
        ("messages", str(status.messages)),
        ("dropped", str(dropped)),
        ("queue_fill", f"{status.queue_fill:.3f}"),
        ("flush_ms", f"{status.flush_ms:.1f}"),
        ("flush_worst_ms", f"{status.flush_worst_ms:.1f}"),
        ("since_progress_ms", f"{(now_ns - status.last_progress_ns) / 1e6:.0f}"),
        ("disk_free_bytes", str(status.disk_free_bytes)),
    ]
    values += [(f"dropped.{topic}", str(drops.count)) for topic, drops in status.dropped.items()]
    level = Level.ERROR if status.error else Level.WARN if dropped else Level.OK
    message = status.error or (f"dropped {dropped} messages" if dropped else "ok")
    return DiagnosticStatus("recorder", level, message, "", tuple(values))
