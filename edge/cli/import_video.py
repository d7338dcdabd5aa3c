"""`mapforest import-video`: the camera's own files, in full resolution, onto a session's time."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from edge.cli import exit_codes
from edge.cli.stage_bar import StageBar
from edge.cli.steps import tell
from edge.config import load
from edge.errors import EdgeError, UsageError
from edge.words import duration

if TYPE_CHECKING:
    from edge.onboard.bring import BringReport

HELP = """bring the camera's own files onto the time of a session, so that its full resolution can be used

example: mapforest import-video recordings/20261124T101500Z_north-slope /media/card/DCIM/100GOPRO
         mapforest import-video recordings/20261124T101500Z_north-slope GX010042.MP4 GX020042.MP4

By the camera's gyroscope (in its telemetry track) and the LiDAR's: the clock of the camera need not be right. The
videos stay where they are; onboard_video.json in the session's folder says which they are, and when each frame was.
Exit code 1 when none of them belongs to the session, 3 when some do not."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("session", type=Path, help="the session's folder")
    parser.add_argument("video", type=Path, nargs="+", help="files as they were on the card, or their folder")
    parser.add_argument("--dry-run", action="store_true", help="measure, and write nothing")


def run(args: argparse.Namespace) -> int:
    """Each recording of the camera for itself; chapters together."""
    from edge.calibration.recording import CalibrationRecording
    from edge.onboard.bring import bring
    from edge.onboard.record import NAME, add_video
    from edge.onboard.telemetry import in_order
    from pipeline.calibration.errors import CalibrationError

    if not args.session.is_dir():
        raise UsageError(f"{args.session}: the folder of a session is expected: what is found is written into it")
    recordings = in_order(args.video)
    session = CalibrationRecording(args.session, load(args.config))
    reports: list[BringReport] = []
    with StageBar(quiet=args.json) as bar:
        for paths in recordings:
            bar.stage(paths[0].name, done=False)
            try:
                note, report = bring(paths, session, bar.advance)
            except CalibrationError as error:
                raise EdgeError(f"{paths[0]}: {error}") from error
            reports.append(report)
            if not report.refusal and not args.dry_run:
                add_video(args.session, note)
    found = sum(not report.refusal for report in reports)
    end = f"{args.session / NAME}: {'left as it was' if args.dry_run or not found else 'written'}"
    tell(args, reports, [*(line for report in reports for line in _lines(report)), end])
    return exit_codes.GOOD if found == len(reports) else exit_codes.WARNINGS if found else exit_codes.FAILED


def _lines(report: BringReport) -> list[str]:
    name = report.files[0] + (f" and {len(report.files) - 1} chapters more" if len(report.files) > 1 else "")
    if report.refusal:
        return [f"{name}: does not belong here, or cannot be told: {report.refusal}"]
    side = "after" if report.begin_s >= 0 else "before"
    sure = f"sigma {1e3 * report.sigma_s:.1f} ms, drift {report.drift_ppm:.0f} ppm"
    return [
        f"{name}: begins {abs(report.begin_s):.3f} s {side} the session, {sure}",
        f"  {duration(report.shared_s)} of {duration(report.duration_s)} in common; correlation "
        f"{report.correlation:.3f}, at any other offset at most {report.rival:.3f}",
    ]
