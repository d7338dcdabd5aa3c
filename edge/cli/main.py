"""The `mapforest` program: a table of commands, each a module that is imported only when it is used."""

from __future__ import annotations

import argparse
import errno
import importlib
import logging
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, cast

from drivers.errors import DriverError
from edge import __version__
from edge.cli import exit_codes
from edge.errors import EdgeError, UsageError
from pipeline.detection.errors import DetectionError

COMMANDS: dict[str, tuple[str, str]] = {
    "demo": ("edge.cli.demo", "the whole mission on the emulated payload"),
    "recorder": ("edge.cli.recorder", "the service: sensors, files, health, control socket"),
    "pipeline": ("edge.cli.pipeline", "the live service: where the payload is and what it sees, recorded as it goes"),
    "tui": ("edge.cli.tui", "the operator's screen: start, stop and mark with one key each"),
    "start": ("edge.cli.start", "start recording"),
    "stop": ("edge.cli.stop", "stop recording and finish the session"),
    "status": ("edge.cli.status", "what the recorder does and how the sensors are"),
    "mark": ("edge.cli.mark", "write a note into the recording"),
    "doctor": ("edge.cli.doctor", "preflight: sensors, clocks, card, permissions, calibration, detector"),
    "validate": ("edge.cli.validate", "judge a recording"),
    "recover": ("edge.cli.recover", "copy everything sound out of a damaged recording"),
    "info": ("edge.cli.info", "topics, types, counts and rates of a recording"),
    "process": ("edge.cli.process", "odometry, GNSS fusion, detection and products from a recording"),
    "refine": ("edge.cli.refine", "the best trajectory and map that a session can give, or several of one site"),
    "batch": ("edge.cli.batch", "process, refine and report over all sessions of a directory, on many cores"),
    "align": ("edge.cli.align", "a ground map brought onto an aerial one, with a verdict"),
    "inventory": ("edge.cli.inventory", "stems, diameters, heights and crowns from a map"),
    "report": ("edge.cli.report", "one HTML page a session: verdict, map, trees, sensors, what to do"),
    "evaluate": ("edge.cli.evaluate", "estimates against ground truth"),
    "dataset": ("edge.cli.dataset", "training data from recordings and photos, and a model from them"),
    "calibrate": ("edge.cli.calibrate", "the lens, where the camera sits, and how late its stamps are"),
    "import-video": ("edge.cli.import_video", "the camera's own files onto the time of a session"),
    "sim": ("edge.cli.sim", "the emulated payload alone, with faults on demand"),
}
"""command -> (module with HELP, add_arguments and run; summary). Import strings: `status` must not load numba."""


class Command(Protocol):
    """What a command's module offers."""

    HELP: str
    """What it does, then an example."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the command's own options."""

    def run(self, args: argparse.Namespace) -> int:
        """Do it; returns an exit code of `edge.cli.exit_codes`."""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point. Exit codes: 0 good, 1 failed, 2 wrong usage, 3 done with warnings."""
    args = sys.argv[1:] if argv is None else list(argv)
    name = next((word for word in args if not word.startswith("-")), "")
    command = _load(name) if name in COMMANDS else None
    options = _parser(name, command).parse_args(args)
    _set_up_logging(options.verbose)
    if command is None:
        return exit_codes.USAGE
    return _run(command, options)


def _load(name: str) -> Command:
    return cast("Command", importlib.import_module(COMMANDS[name][0]))


def _parser(chosen: str, command: Command | None) -> argparse.ArgumentParser:
    """All names are listed; only the chosen command's module is loaded."""
    parser = argparse.ArgumentParser(
        prog="mapforest",
        description="Map forests and find an invasive tree: record, watch, validate.",
        epilog="exit codes: 0 good, 1 failed, 2 wrong usage, 3 done with warnings",
    )
    parser.add_argument("--version", action="version", version=f"mapforest {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name, (_, summary) in COMMANDS.items():
        text = command.HELP if command is not None and name == chosen else None
        sub = commands.add_parser(
            name, help=summary, description=text, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        if command is not None and name == chosen:
            _add_common(sub)
            command.add_arguments(sub)
    return parser


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", type=Path, default=_default_config(), metavar="FILE", help="TOML configuration")
    parser.add_argument("--json", action="store_true", help="print JSON for programs")
    parser.add_argument("--verbose", "-v", action="store_true", help="say more on standard error")


def _default_config() -> Path | None:
    """MAPFOREST_CONFIG, else the installed file, else the defaults."""
    named = os.environ.get("MAPFOREST_CONFIG")
    if named:
        return Path(named)
    installed = Path("/etc/mapforest/mapforest.toml")
    return installed if installed.exists() else None


def _set_up_logging(verbose: bool) -> None:
    """To standard error; under systemd with the priority prefixes that journald reads."""
    under_systemd = "JOURNAL_STREAM" in os.environ
    handler = logging.StreamHandler()
    handler.setFormatter(
        _JournalFormatter() if under_systemd else logging.Formatter("%(levelname)s %(name)s: %(message)s")
    )
    logging.basicConfig(level=logging.DEBUG if verbose else logging.INFO, handlers=[handler], force=True)
    logging.getLogger("laspy").setLevel(logging.CRITICAL)  # it raises as well what it logs


class _JournalFormatter(logging.Formatter):
    """Prefixes the syslog priority: <3> error, <4> warning, <6> info, <7> debug."""

    def format(self, record: logging.LogRecord) -> str:
        level = 3 if record.levelno >= logging.ERROR else 4 if record.levelno >= logging.WARNING else 6
        level = 7 if record.levelno < logging.INFO else level
        return f"<{level}>{record.name}: {super().format(record)}"


def _run(command: Command, options: argparse.Namespace) -> int:
    try:
        return command.run(options)
    except UsageError as error:
        print(f"mapforest: {error}", file=sys.stderr)
        return exit_codes.USAGE
    except (EdgeError, DriverError, DetectionError) as error:
        print(f"mapforest: {error}", file=sys.stderr)
        return exit_codes.FAILED
    except KeyboardInterrupt:
        print("mapforest: interrupted", file=sys.stderr)
        return exit_codes.FAILED
    except BrokenPipeError:  # `mapforest info | head`: the reader left, nothing is wrong
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return exit_codes.GOOD
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        where = f" ({error.filename})" if error.filename else ""
        print(f"mapforest: the disk is full{where}: make room and run the same again", file=sys.stderr)
        return exit_codes.FAILED


if __name__ == "__main__":
    sys.exit(main())
