"""`mapforest sim`: the emulated payload alone."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import msgspec

from drivers.sim import faults, scenarios
from drivers.sim.payload import Payload, PayloadConfig
from edge import toml_table
from edge.cli import exit_codes
from edge.cli.ending import end_with_the_terminal
from edge.errors import UsageError

HELP = """run the emulated payload alone, in real time, with faults on demand

example: mapforest sim --scenario dense --fault livox:loss=0.05 --fault reach:stall@30+7

Three sensors on loopback addresses speak their real protocols from one simulated forest. Point a recorder
at them with the configuration that --print-config prints. Ctrl-C ends it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--scenario", default="demo", help="which walk (--list names them)")
    parser.add_argument("--seed", type=int, help="another forest and walk of the same kind")
    parser.add_argument("--gnss", default="honest", help="GNSS errors: clean, honest, dishonest, corrupted")
    parser.add_argument("--fault", action="append", default=[], metavar="FAULT", help="sensor:kind[=value][@s[+s]]")
    parser.add_argument("--duration", type=float, metavar="S", help="end after so many seconds")
    parser.add_argument("--truth", type=Path, metavar="FOLDER", help="write what is true, for `mapforest evaluate`")
    parser.add_argument("--list", action="store_true", help="list scenarios and kinds of faults, and end")
    parser.add_argument("--print-config", action="store_true", help="print the recorder's configuration, and end")


def run(args: argparse.Namespace) -> int:
    """Emulate until interrupted or until the duration is over."""
    if args.list:
        _list(sorted(scenarios.SCENARIOS), faults.KINDS, as_json=args.json)
        return exit_codes.GOOD
    if args.duration is not None and args.duration <= 0:
        raise UsageError(f"--duration {args.duration:g}: must be above 0")
    plan = tuple(faults.parse(text) for text in args.fault)
    config = PayloadConfig(scenarios.scenario(args.scenario, args.seed), args.gnss, plan, args.truth)
    if args.print_config:
        print(toml_table.render({"sensors": config.driver_tables()}))
        return exit_codes.GOOD
    end_with_the_terminal()
    with Payload(config) as payload:
        print(f"emulated payload is up: {', '.join(payload.processes)} on loopback; Ctrl-C ends it")
        _idle(payload, args.duration)
    return exit_codes.GOOD


def _idle(payload: Payload, duration_s: float | None) -> None:
    end_s = None if duration_s is None else time.monotonic() + duration_s
    try:
        while end_s is None or time.monotonic() < end_s:
            payload.check()
            time.sleep(0.2)
    except KeyboardInterrupt:
        return


def _list(names: list[str], kinds: dict[str, str], *, as_json: bool) -> None:
    if as_json:
        print(msgspec.json.encode({"scenarios": names, "faults": kinds}).decode())
        return
    print("scenarios:", ", ".join(names))
    print("faults, written sensor:kind[=value][@start_s[+duration_s]]:")
    for kind, unit in kinds.items():
        print(f"  {kind:14} {unit}")
