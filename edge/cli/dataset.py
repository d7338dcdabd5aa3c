"""`mapforest dataset`: from recordings and photos to training data, and from those to a model."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import cast

from edge.cli import dataset_in, dataset_out, dataset_split, dataset_train
from edge.errors import EdgeError, UsageError

HELP = """from recordings and photos to training data, and from those to a model for the payload

example: mapforest dataset frames recordings/20261124T101500Z_north-slope --output trees
         mapforest dataset tasks trees --output tasks.json        (label them in Label Studio, export as YOLO or JSON)
         mapforest dataset labels project-1.zip trees
         mapforest dataset inaturalist photos --observations observations.csv --output trees
         mapforest dataset split trees
         mapforest dataset check trees
         mapforest dataset train trees --trainer ~/yolo --accept-agpl

A dataset is a folder with images/, labels/ (YOLO), classes.txt, manifest.jsonl and sites.csv. docs/dataset.md goes
through all of it. `mapforest dataset WHAT --help` has the options of each step."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """A parser for each step; what holds for all may stand before or after its name."""
    steps = parser.add_subparsers(title="steps", metavar="WHAT", dest="what", required=True)
    for module in (dataset_in, dataset_out, dataset_split, dataset_train):
        for name, (summary, add, run) in module.STEPS.items():
            step = steps.add_parser(
                name, help=summary, description=summary, formatter_class=argparse.RawDescriptionHelpFormatter
            )
            _add_common(step)
            add(step)
            step.set_defaults(step=run)


def _add_common(step: argparse.ArgumentParser) -> None:
    """The options of every command once more, without a default that would undo what stood before the step."""
    told = argparse.SUPPRESS
    step.add_argument("--config", type=Path, default=told, metavar="FILE", help="TOML configuration")
    step.add_argument("--json", action="store_true", default=told, help="print JSON for programs")
    step.add_argument("--verbose", "-v", action="store_true", default=told, help="say more on standard error")


def run(args: argparse.Namespace) -> int:
    """The step that was asked for."""
    from pipeline.dataset.errors import DatasetError, SplitRefused

    step = cast("Callable[[argparse.Namespace], int]", args.step)
    try:
        return step(args)
    except SplitRefused as error:
        raise UsageError(str(error)) from error
    except DatasetError as error:
        raise EdgeError(str(error)) from error
