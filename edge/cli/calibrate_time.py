"""How late the camera's stamps are."""

from __future__ import annotations

import argparse
from pathlib import Path

from edge.cli.calibrate_file import add_file, chosen_file, finish
from edge.cli.stage_bar import StageBar
from edge.cli.steps import Step
from edge.config import load


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("session", type=Path, help="a recording in which the payload turns, for half a minute and more")
    parser.add_argument("--seconds", type=float, default=60.0, metavar="S", help="of the video that are looked at")
    add_file(parser)


def _run(args: argparse.Namespace) -> int:
    from edge.calibration.file import read_or_nominal
    from edge.calibration.recording import CalibrationRecording
    from edge.calibration.time_offset import completed, measure

    config = load(args.config)
    path = chosen_file(args, config)
    file, recording = read_or_nominal(path), CalibrationRecording(args.session, config)
    with StageBar(quiet=args.json) as bar:
        bar.stage("time", done=False)
        report = measure(recording, file, bar.advance, args.seconds)
    seen = f"{report.frames:,} frames, {report.stretches} stretches, turning {report.turning_deg_s:.0f} deg/s"
    lines = [f"  correlation {report.correlation:.3f}, at any other offset at most {report.rival:.3f}; {seen}"]
    if not report.refusal:
        told = f"{1e3 * report.camera_late_s:.1f} ms late, sigma {1e3 * report.sigma_s:.1f} ms"
        lines.insert(0, f"{report.session}: the camera's stamps are {told}")
        lines.append(f"  the camera's rotation seen in passing is {report.mounted_off_deg:.1f} deg off the file's")
    verdict = (report.refusal, report.warning)
    return finish(args, path, (report, lines), verdict, completed(file, report, recording))


STEPS: dict[str, Step] = {"time": ("how late the camera's stamps are, from turning", _options, _run)}
