"""`mapforest calibrate`: one file that says how the camera sees, where it sits and how late it is."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import cast

from edge.cli import calibrate_lens, calibrate_pose, calibrate_time
from edge.cli.steps import add_steps
from edge.errors import EdgeError

HELP = """how the camera sees, where it sits, and how late its stamps are: one file, completed step by step

example: mapforest calibrate print board.png --corners 9x6 --square 0.025 --marker 0.018
         mapforest calibrate lens board.mp4 --corners 9x6 --square 0.025 --file payload-1.toml
         mapforest calibrate board recordings/20261124T102000Z_board --corners 8x5 --square 0.08 --file payload-1.toml
         mapforest calibrate scene recordings/20261124T103000Z_standing --file payload-1.toml --picture overlay.png
         mapforest calibrate time recordings/20261124T101500Z_turning --file payload-1.toml

Set `calibration = "payload-1.toml"` in the configuration afterwards: it then goes into every recording. A step that
cannot tell says so, and leaves the file as it was (exit code 1). docs/calibration.md goes through all of it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """A parser for each step."""
    add_steps(parser, (calibrate_lens, calibrate_pose, calibrate_time))


def run(args: argparse.Namespace) -> int:
    """The step that was asked for."""
    from pipeline.calibration.errors import CalibrationError

    step = cast("Callable[[argparse.Namespace], int]", args.step)
    try:
        return step(args)
    except CalibrationError as error:
        raise EdgeError(str(error)) from error
