"""Where the camera sits: from a board, or from what is there."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from edge.cli.calibrate_file import add_file, chosen_file, finish
from edge.cli.calibrate_lens import add_board, board_of
from edge.cli.stage_bar import StageBar
from edge.cli.steps import Step
from edge.config import load

if TYPE_CHECKING:
    from edge.calibration.board_pose import BoardReport
    from edge.calibration.scene_pose import SceneReport


def _board_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("session", type=Path, help="a recording of a board, held still in ten poses and more")
    add_board(parser)
    add_file(parser)


def _board(args: argparse.Namespace) -> int:
    from edge.calibration.board_pose import completed, measure
    from edge.calibration.file import read_or_nominal
    from edge.calibration.recording import CalibrationRecording

    config = load(args.config)
    path = chosen_file(args, config)
    file, recording = read_or_nominal(path), CalibrationRecording(args.session, config)
    with StageBar(quiet=args.json) as bar:
        bar.stage("board", done=False)
        found, report = measure(recording, board_of(args), file, bar.advance)
    made = completed(file, found, recording)
    return finish(args, path, (report, _board_lines(report)), (report.refusal, ""), made)


def _board_lines(report: BoardReport) -> list[str]:
    used = [hold for hold in report.holds if not hold.why]
    return [
        f"{report.session}: {told_pose(report)}",
        f"  {1e3 * report.residual_m:.1f} mm RMS over {len(used)} of {len(report.holds)} poses",
        *(f"  left out: at {hold.name}, {hold.why}" for hold in report.holds if hold.why),
    ]


def _scene_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("session", type=Path, help="a recording in which the payload stands still at a few places")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw the points over pictures, before and after")
    parser.add_argument("--stand", type=float, default=3.0, metavar="S", help="to stand still means for so long")
    add_file(parser)


def _scene(args: argparse.Namespace) -> int:
    from edge.calibration.file import read_or_nominal
    from edge.calibration.lens import save_picture
    from edge.calibration.recording import CalibrationRecording
    from edge.calibration.scene_pose import completed, measure

    config = load(args.config)
    path = chosen_file(args, config)
    file, recording = read_or_nominal(path), CalibrationRecording(args.session, config)
    with StageBar(quiet=args.json) as bar:
        bar.stage("scene", done=False)
        found, report, picture = measure(recording, file, args.stand, bar.advance)
    if args.picture is not None:
        save_picture(args.picture, picture)
    lines = [
        "" if report.refusal else f"{report.session}: {told_pose(report)}",
        f"  {report.edges:,} points of edges at {report.stands} places; the contrast is {report.standout:.1f} standard "
        f"deviations above that of other poses; {report.agreed:.0%} of the starts agree",
        f"  {args.picture}: before on the left, after on the right" if args.picture is not None else "",
    ]
    made = completed(file, found, recording)
    return finish(args, path, (report, lines), (report.refusal, ""), made)


def told_pose(report: BoardReport | SceneReport) -> str:
    """How sure, and how far from the guess."""
    sure = f"{report.rotation_sigma_deg:.2f} deg and {1e3 * report.translation_sigma_m:.0f} mm (one sigma)"
    moved = f"{report.moved_deg:.1f} deg and {1e3 * report.moved_m:.0f} mm"
    return f"the camera's pose to {sure}, {moved} from what the file said"


STEPS: dict[str, Step] = {
    "scene": ("where the camera sits, from standing still among trees", _scene_options, _scene),
    "board": ("where the camera sits, from a board that camera and LiDAR see", _board_options, _board),
}
