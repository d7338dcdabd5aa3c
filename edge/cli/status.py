"""`mapforest status`."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator

import msgspec

from edge.cli import exit_codes
from edge.cli.asking import connect
from edge.control.client import ControlClient
from edge.control.messages import Detecting, Gnss, Host, Location, Mapped, Recording, Sensor, Status, Verdict

HELP = """show what the recorder does and how the sensors are

example: mapforest status --watch
Ends with 0 when all is well, 3 when a sensor, the recorder or the detector has a problem."""

_MIB = 1 << 20
_CLEAR = "\x1b[H\x1b[2J"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Once or again and again."""
    parser.add_argument("--watch", "-w", action="store_true", help="keep showing it until Ctrl-C")


def run(args: argparse.Namespace) -> int:
    """ControlError when the recorder cannot be reached."""
    with connect(args) as client:
        if args.watch:
            return _watch(args, client)
        status = client.status()
        sys.stdout.write(_text(args, status))
        return exit_codes.GOOD if _is_well(status) else exit_codes.WARNINGS


def lines(status: Status) -> Iterator[str]:
    """The compact view for people."""
    yield _headline(status)
    if status.recording:
        yield from _recording_lines(status.recording)
    for sensor in status.sensors:
        yield from _sensor_lines(sensor)
    if status.gnss:
        yield _gnss_line(status.gnss)
    if status.location:
        yield _location_line(status.location)
    if status.detecting:
        yield _detecting_line(status.detecting)
    if status.mapped:
        yield _mapped_line(status.mapped)
    yield from _host_lines(status.host)
    if status.verdict:
        yield from _verdict_lines(status.verdict)
    for problem in status.problems:
        yield f"! {problem}"


def _watch(args: argparse.Namespace, client: ControlClient) -> int:
    clear = _CLEAR if sys.stdout.isatty() and not args.json else ""
    with contextlib.suppress(KeyboardInterrupt):
        for status in client.subscribe():
            sys.stdout.write(clear + _text(args, status))
            sys.stdout.flush()
    return exit_codes.GOOD


def _text(args: argparse.Namespace, status: Status) -> str:
    if args.json:
        return msgspec.json.encode(status).decode() + "\n"
    return "\n".join(lines(status)) + "\n"


def _is_well(status: Status) -> bool:
    detecting = status.detecting
    fails = detecting is not None and detecting.state == "failed"
    return not status.problems and not fails and all(sensor.state == "ok" for sensor in status.sensors)


def _headline(status: Status) -> str:
    if status.recording is None:
        return status.state.upper()
    return f"{status.state.upper()} {status.recording.session}  {_duration(status.recording.elapsed_s)}"


def _recording_lines(recording: Recording) -> Iterator[str]:
    yield (
        f"  {recording.bytes_written / _MIB:.1f} MiB, {recording.messages} messages, split {recording.split}, "
        f"{recording.marks} marks, {recording.dropped} dropped, last flush {recording.flush_ms:.0f} ms"
    )
    yield f"  {recording.folder}"


def _sensor_lines(sensor: Sensor) -> Iterator[str]:
    rates = "  ".join(
        f"{stream.name} {stream.rate_hz:.1f}/{stream.expected_hz:g} Hz"
        + (f" lost {stream.lost}" if stream.lost else "")
        for stream in sensor.streams
    )
    extras = [f"{sensor.temperature_c:.0f} C"] if sensor.temperature_c is not None else []
    extras += [f"battery {sensor.battery_percent:.0f} %"] if sensor.battery_percent is not None else []
    extras += [f"clock +-{sensor.clock.sigma_ms:.2f} ms"] if sensor.clock is not None else []
    yield f"{sensor.name:<8} {sensor.state:<10} {'  '.join([rates, *extras]).strip()}".rstrip()
    if sensor.problem:
        yield f"  ! {sensor.problem}" + (f": {sensor.advice}" if sensor.advice else "")


def _location_line(location: Location) -> str:
    frame = "map" if location.georeferenced else "local"
    line = (
        f"pose     {location.state}, {location.distance_m:.1f} m travelled, {location.speed_m_s:.1f} m/s, sigma "
        f"{location.sigma_m:.2f} m ({frame})"
    )
    if location.dropped or location.thinned < 1.0:
        line += f", {location.thinned:.0%} of the points, {location.dropped} sweeps left out"
    return f"{line}  {location.note}".rstrip()


def _detecting_line(detecting: Detecting) -> str:
    line = f"detect   {detecting.state}, {detecting.model}"
    if detecting.device:
        line += (
            f" on {detecting.device}, {detecting.rate_hz:.1f} images/s, {detecting.latency_ms:.0f} ms behind, "
            f"{detecting.boxes} boxes in the last second"
        )
    return f"{line}  {detecting.note}".rstrip()


def _mapped_line(mapped: Mapped) -> str:
    line = f"trees    {mapped.trees} found in {mapped.views} images"
    if mapped.range_m is not None:
        line += f", the last {mapped.range_m:.1f} m away at {mapped.bearing_deg:.0f} degrees right of ahead"
    return line


def _gnss_line(gnss: Gnss) -> str:
    return (
        f"gnss     {gnss.quality_name}, {gnss.satellites} satellites, sigma {gnss.sigma_horizontal_m:.2f} m horizontal "
        f"{gnss.sigma_vertical_m:.2f} m vertical, {gnss.age_s:.1f} s ago"
    )


def _host_lines(host: Host) -> Iterator[str]:
    heat = f", {host.temperature_c:.0f} C" if host.temperature_c is not None else ""
    throttled = ", THROTTLED" if host.throttled else ""
    left = f", {_duration(host.disk_remaining_s)} left" if host.disk_remaining_s is not None else ""
    battery = f", battery {_duration(host.battery_remaining_s)} left" if host.battery_remaining_s is not None else ""
    yield f"host     cpu {host.cpu_percent:.0f} %, memory {host.memory_percent:.0f} %{heat}{throttled}{battery}"
    yield f"card     {host.disk_free_bytes / _MIB / 1024:.1f} GiB free{left}, queue {host.queue_fill:.0%}"
    yield f"clock    {'synchronised by ' + host.clock_source if host.clock_synchronised else 'not synchronised'}"


def _verdict_lines(verdict: Verdict) -> Iterator[str]:
    yield f"verdict  {'validating' if verdict.running else verdict.verdict} {verdict.session}"
    for reason in verdict.reasons:
        yield f"  - {reason}"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"
