"""What is wrong right now, worst first: the banner names it, and the bell rings for what is new."""

from __future__ import annotations

from dataclasses import dataclass

from edge.control.messages import Host, Sensor, Status
from ui import units
from ui.situation import Situation
from ui.tone import Tone

QUEUE_WARN, QUEUE_BAD = 0.5, 0.85
LEFT_WARN_S, LEFT_BAD_S = 15 * 60.0, 3 * 60.0
"""Time left on the card or the battery: enough to walk out, and enough to press the key."""
FLUSH_WARN_MS = 2000.0
"""A good card flushes in some 10 ms; past this it is having one of its pauses."""


@dataclass(frozen=True)
class Fault:
    """key: stays the same while the fault lasts, so that the bell rings once."""

    key: str
    tone: Tone
    text: str


def faults(situation: Situation) -> tuple[Fault, ...]:
    """All faults of the situation, worst first. An old status has one only: that it is old."""
    status = situation.status
    if situation.stale or status is None:
        return (Fault("link", Tone.BAD, "no contact"),)
    found = [
        *(Fault(f"recorder: {problem}", Tone.BAD, problem) for problem in status.problems),
        *_sensor_faults(status),
        *_recording_faults(status),
        *_host_faults(status.host),
    ]
    return tuple(sorted(found, key=lambda fault: fault.tone is not Tone.BAD))


def sensor_tone(sensor: Sensor, recording: bool) -> Tone:
    """A sensor that is not there is a matter of patience before the recording, and a hole in it afterwards."""
    match sensor.state:
        case "ok":
            return Tone.GOOD
        case "starting" | "degraded":
            return Tone.WARN
        case "searching":
            return Tone.BAD if recording else Tone.WARN
        case _:
            return Tone.BAD


def left_tone(left_s: float | None) -> Tone:
    """How worrying the time left on the card or the battery is."""
    if left_s is None:
        return Tone.QUIET
    return Tone.BAD if left_s < LEFT_BAD_S else Tone.WARN if left_s < LEFT_WARN_S else Tone.QUIET


def queue_tone(fill: float) -> Tone:
    return Tone.BAD if fill >= QUEUE_BAD else Tone.WARN if fill >= QUEUE_WARN else Tone.QUIET


def _sensor_faults(status: Status) -> list[Fault]:
    recording = status.state == "recording"
    return [
        Fault(f"{sensor.name} {sensor.state}", sensor_tone(sensor, recording), f"{sensor.name} {sensor.state.upper()}")
        for sensor in status.sensors
        if sensor.state != "ok"
    ]


def _recording_faults(status: Status) -> list[Fault]:
    recording = status.recording
    if recording is None:
        return []
    found = []
    if recording.dropped:
        found.append(Fault("dropped", Tone.BAD, f"{units.count(recording.dropped)} messages LOST: queue was full"))
    if recording.flush_ms > FLUSH_WARN_MS:
        found.append(Fault("flush", Tone.WARN, f"card slow: {recording.flush_ms / 1000:.1f} s to flush"))
    return found


def _host_faults(host: Host) -> list[Fault]:
    candidates = (
        Fault("queue", queue_tone(host.queue_fill), f"queue {host.queue_fill:.0%} full"),
        Fault("card", left_tone(host.disk_remaining_s), f"card: {units.remaining(host.disk_remaining_s)} left"),
        Fault(
            "battery", left_tone(host.battery_remaining_s), f"battery: {units.remaining(host.battery_remaining_s)} left"
        ),
        Fault("throttled", Tone.WARN if host.throttled else Tone.QUIET, "computer throttled: shade it, let air in"),
    )
    return [fault for fault in candidates if fault.tone is not Tone.QUIET]
