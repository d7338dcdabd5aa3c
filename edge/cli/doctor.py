"""`mapforest doctor`: is everything ready for a walk."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping

import msgspec
from rich.console import Console
from rich.table import Table

from edge.cli import exit_codes
from edge.config import Config, load
from edge.control.client import ControlClient
from edge.control.messages import Status
from edge.errors import ControlError
from edge.paths import find_control_socket
from edge.preflight import calibration, detection, disk, host, sensors
from edge.preflight.check import Check, Outcome
from edge.service.host_clock import discipline

HELP = """check sensors, clocks, card, permissions, calibration and detector before a walk

example: mapforest doctor --config payload.toml

Each line that is not good says what to do. Exit code 0: ready; 3: ready, with warnings; 1: not ready."""
_STYLES = {Outcome.GOOD: ("✓", "green"), Outcome.WARNING: ("!", "yellow"), Outcome.BAD: ("✗", "bold red")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--listen", type=float, default=sensors.LISTEN_S, metavar="S", help="wait for sensors so long")


def run(args: argparse.Namespace) -> int:
    """Print the list; the worst line decides the exit code."""
    config = load(args.config)
    checks = _checks(config, _running(config), args.listen)
    if args.json:
        print(msgspec.json.encode(checks).decode())
    else:
        _show(checks)
    worst = {check.outcome for check in checks}
    if Outcome.BAD in worst:
        return exit_codes.FAILED
    return exit_codes.WARNINGS if Outcome.WARNING in worst else exit_codes.GOOD


def _running(config: Config) -> Status | None:
    """What the recorder says, when one runs here."""
    try:
        with ControlClient(find_control_socket(config)) as client:
            return client.status()
    except ControlError:
        return None


def _checks(config: Config, status: Status | None, listen_s: float) -> list[Check]:
    clock = discipline()
    heard, details = _sensors(config, status, listen_s)
    recorder = Check("recorder", Outcome.GOOD, f"running, {status.state}") if status else _not_running()
    return [
        recorder,
        *heard,
        *disk.check_disk(config.recording),
        host.check_clock(time.time(), clock.synchronised, clock.source),
        host.check_kernel(),
        *host.check_permissions(config),
        *calibration.check_calibration(config, calibration.units_of(config, details)),
        *detection.check_detection(config),
        host.check_programs(),
    ]


def _sensors(
    config: Config, status: Status | None, listen_s: float
) -> tuple[list[Check], dict[str, Mapping[str, object]]]:
    """And what each says of itself."""
    if status is not None:
        return sensors.check_running(status), {sensor.name: sensor.details for sensor in status.sensors}
    healths = sensors.listen(config, listen_s)
    return sensors.check_heard(healths), {health.name: health.details for health in healths}


def _not_running() -> Check:
    advice = "sudo systemctl start mapforest-recorder, or `mapforest recorder` in a terminal"
    return Check("recorder", Outcome.WARNING, "not running; the sensors were listened to directly", advice)


def _show(checks: list[Check]) -> None:
    table = Table(box=None, show_header=False, padding=(0, 1))
    for check in checks:
        mark, style = _STYLES[check.outcome]
        table.add_row(f"[{style}]{mark}[/]", check.subject, check.found)
        if check.advice:
            table.add_row("", "", f"[dim]→ {check.advice}[/]")
    Console().print(table)
