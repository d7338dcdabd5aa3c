"""What the steps of `mapforest calibrate` have in common: which file they complete, and how they end."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from edge.cli import exit_codes
from edge.cli.steps import tell
from edge.config import Config

if TYPE_CHECKING:
    from edge.recording.calibration import CalibrationFile

DEFAULT = Path("calibration.toml")


def add_file(parser: argparse.ArgumentParser) -> None:
    """--file and --dry-run."""
    parser.add_argument(
        "--file",
        type=Path,
        metavar="FILE",
        help=f"the calibration to complete (default: the one of the configuration, else {DEFAULT})",
    )
    parser.add_argument("--dry-run", action="store_true", help="measure, and leave the file as it is")


def chosen_file(args: argparse.Namespace, config: Config) -> Path:
    """The one asked for, else the configured one."""
    if args.file is not None:
        return Path(args.file)
    return Path(config.calibration).expanduser() if config.calibration else DEFAULT


def finish(
    args: argparse.Namespace,
    path: Path,
    found: tuple[object, Sequence[str]],
    verdict: tuple[str, str],
    made: CalibrationFile,
) -> int:
    """Tell; write unless refused or dry. found: the report and its lines; verdict: refusal and warning, in words."""
    from edge.calibration.file import write

    report, lines = found
    refusal, warning = verdict
    kept = refusal or args.dry_run
    if not kept:
        write(path, made)
    end = [
        f"cannot be told: {refusal}" if refusal else "",
        f"warning: {warning}" if warning else "",
        f"{path}: {'left as it was' if kept else 'written'}",
    ]
    tell(args, report, [*lines, *end])
    return exit_codes.FAILED if refusal else exit_codes.WARNINGS if warning else exit_codes.GOOD
