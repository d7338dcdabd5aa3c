"""`mapforest dataset`: from recordings and photos to training data, and from those to a model."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import cast

from edge.cli import dataset_in, dataset_out, dataset_split, dataset_train
from edge.cli.steps import add_steps
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
    add_steps(parser, (dataset_in, dataset_out, dataset_split, dataset_train))


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
