"""The lens, from pictures of a board; and the board to print."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from edge.cli import exit_codes
from edge.cli.calibrate_file import add_file, chosen_file, finish
from edge.cli.stage_bar import StageBar
from edge.cli.steps import Step, tell
from edge.config import load
from edge.errors import UsageError

if TYPE_CHECKING:
    from edge.calibration.lens import LensReport
    from pipeline.calibration.board import Board


def add_board(parser: argparse.ArgumentParser) -> None:
    """What the board is like."""
    parser.add_argument("--corners", required=True, metavar="CxR", help="inner corners, columns x rows: 9x6")
    parser.add_argument(
        "--square", type=float, required=True, metavar="M", help="side of a square, measured, in metres"
    )
    parser.add_argument(
        "--marker", type=float, default=0.0, metavar="M", help="side of a marker: it is a ChArUco board"
    )
    parser.add_argument("--dictionary", default="5X5_100", help="of the markers, as OpenCV calls it")


def board_of(args: argparse.Namespace) -> Board:
    """UsageError for a size that is none."""
    from pipeline.calibration.board import Board

    columns, _, rows = args.corners.lower().partition("x")
    if not (columns.isdigit() and rows.isdigit()):
        raise UsageError(f"--corners {args.corners}: columns x rows of inner corners are expected, such as 9x6")
    kind: Literal["chessboard", "charuco"] = "charuco" if args.marker else "chessboard"
    return Board(int(columns), int(rows), args.square, kind, args.marker, args.dictionary)


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", type=Path, nargs="+", help="pictures, a folder of them, a video, or a recording")
    add_board(parser)
    parser.add_argument(
        "--model", choices=["pinhole", "fisheye"], default="pinhole", help="of the lens (wide: fisheye)"
    )
    parser.add_argument(
        "--every", type=float, default=0.2, metavar="S", help="of a video, look at a picture each S seconds"
    )
    parser.add_argument(
        "--lens", default="", metavar="NAME", help="the camera's lens mode, for the record: linear, wide"
    )
    parser.add_argument("--camera-serial", default="", metavar="NO", help="whose lens it is (default: as recorded)")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw where corners were, and what is left over")
    add_file(parser)


def _run(args: argparse.Namespace) -> int:
    from edge.calibration.file import read_or_nominal
    from edge.calibration.lens import LensSearch, completed, save_picture
    from edge.calibration.pictures import pictures
    from edge.calibration.units import Units

    config = load(args.config)
    path, search = chosen_file(args, config), LensSearch(board_of(args))
    file = read_or_nominal(path)
    with StageBar(quiet=args.json) as bar:
        bar.stage("board", done=False)
        search.look(pictures(args.source, config, args.every, bar.advance))
        bar.stage("lens", done=False)
        found, report = search.fit(args.model)
    if args.picture is not None:
        save_picture(args.picture, search.map(found))
    made = completed(file, report, args.lens, Units(camera=args.camera_serial))
    return finish(args, path, (report, _lines(report)), ("", "; ".join(report.concerns)), made)


def _lines(report: LensReport) -> list[str]:
    lens, by_rms = report.intrinsics, sorted(report.views, key=lambda view: -view.rms_px)
    (fx, fy), (cx, cy) = lens.focal_px, lens.centre_px
    apart = f"; halves of them give focal lengths {report.focal_apart:.2%} apart" if report.focal_apart >= 0 else ""
    return [
        f"{lens.model} {lens.width_px}x{lens.height_px}: focal {fx:.1f} {fy:.1f} px, centre {cx:.1f} {cy:.1f} px",
        f"  distortion {' '.join(f'{value:.4f}' for value in lens.distortion)}",
        f"  {lens.residual_px:.3f} px RMS over {report.used} pictures of {report.seen} looked at "
        f"({report.alike} alike and {report.shaken} shaken left out){apart}",
        f"  {report.covered:.0%} of the picture covered:",
        *("    " + " ".join(f"{count:4d}" for count in row) for row in report.coverage),
        "  worst: " + ", ".join(f"{v.name} {v.rms_px:.2f} px{'' if v.used else ' (left out)'}" for v in by_rms[:3]),
    ]


def _print_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("picture", type=Path, help="PNG to write")
    add_board(parser)
    parser.add_argument("--dpi", type=int, default=300, help="of the printer: prints at its size when not scaled")


def _print(args: argparse.Namespace) -> int:
    from edge.calibration.lens import save_picture
    from pipeline.calibration.board import picture

    board = board_of(args)
    square_px = round(board.square_m / 0.0254 * args.dpi)
    image = picture(board, square_px)
    save_picture(args.picture, image)
    width, height = (side / args.dpi * 25.4 for side in (image.shape[1], image.shape[0]))
    advice = f"print it {width:.0f} x {height:.0f} mm, glue it to something flat, and measure the squares"
    tell(args, {"picture": str(args.picture), "width_mm": width, "height_mm": height}, [f"{args.picture}: {advice}"])
    return exit_codes.GOOD


STEPS: dict[str, Step] = {
    "lens": ("the lens, from pictures or a video of a board", _options, _run),
    "print": ("the board to print, as a picture", _print_options, _print),
}
