"""`mapforest evaluate detection`: a detector, or what one said, against labelled images."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from edge.cli import exit_codes
from edge.cli.stage_bar import StageBar
from edge.cli.words import console
from edge.config import load
from edge.errors import EdgeError, UsageError
from pipeline.evaluation.errors import EvaluationError

if TYPE_CHECKING:  # heavy: OpenCV
    from pipeline.evaluation.dataset import Boxes, Dataset
    from pipeline.evaluation.detection import DetectionReport, Evaluated, Figures


def run(args: argparse.Namespace) -> int:
    """Print the figures, and write what was asked for."""
    from pipeline.evaluation.dataset import read_dataset
    from pipeline.evaluation.detection import evaluate

    if args.dataset is None:
        raise UsageError("evaluate detection: a dataset is missing: `mapforest evaluate detection MODEL DATASET`")
    config = load(args.config)
    confidence = config.detection.confidence if args.confidence is None else args.confidence
    try:
        dataset = read_dataset(args.dataset)
        found, names = _found(args, dataset)
        evaluated = evaluate(dataset, found, names, confidence)
        written = _write(args, evaluated)
    except EvaluationError as error:
        raise EdgeError(str(error)) from error
    if args.json:
        print(msgspec.json.encode(evaluated.report).decode())
        return exit_codes.GOOD
    out = console()
    show(out, evaluated.report)
    for path, what in written.items():
        out.print(f"{path}  {what}", highlight=False, soft_wrap=True)
    return exit_codes.GOOD


def show(out: Console, report: DetectionReport) -> None:
    """The report for people."""
    from pipeline.evaluation.detection import BACKGROUND

    out.print(_table("class", report.classes | ({"all": report.overall} if len(report.classes) > 1 else {}), report))
    if len(report.sites) > 1:
        out.print(_table("site", report.sites, report))
    for name, interval in report.intervals.items():
        out.print(
            f"{name}: {interval.low:.3f} to {interval.high:.3f} in 95 % ({report.resampled} drawn anew)",
            highlight=False,
        )
    out.print("rows: what is there; columns: what was said of it")
    confusion = Table(box=None)
    names = (*report.names, BACKGROUND)
    for name in ("", *names):
        confusion.add_column(name, justify="right" if name else "left")
    for name, counts in zip(names, report.confusion, strict=True):
        confusion.add_row(name, *map(str, counts))
    out.print(confusion)
    for note in report.notes:
        out.print(escape(note), highlight=False)


def _table(what: str, rows: dict[str, Figures], report: DetectionReport) -> Table:
    from pipeline.products.detection_page import COLUMNS, row

    title = f"confidence {report.confidence:g}, IoU {report.iou:g}"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    table.add_column(what)
    for column in COLUMNS:
        table.add_column(column, justify="right", no_wrap=True)
    for name, figures in rows.items():
        table.add_row(escape(name), *row(figures))
    return table


def _found(args: argparse.Namespace, dataset: Dataset) -> tuple[dict[str, Boxes], tuple[str, ...]]:
    from edge.detection import DEMO, open_detector
    from pipeline.evaluation.predictions import UNSURE, predict, read_predictions

    if str(args.estimate) != DEMO and args.estimate.is_dir():
        return read_predictions(args.estimate, dataset)
    settings = msgspec.structs.replace(load(args.config).detection, model=str(args.estimate))
    detector = open_detector(settings, confidence=UNSURE)
    with StageBar(quiet=args.json) as bar:
        bar.stage("detection", done=False)
        return predict(dataset, detector, bar.advance), detector.info.class_names


def _write(args: argparse.Namespace, evaluated: Evaluated) -> dict[Path, str]:
    from pipeline.products.contact_sheet import write_contact_sheet
    from pipeline.products.detection_page import write_detection_page

    written: dict[Path, str] = {}
    try:
        if args.page is not None:
            write_detection_page(args.page, f"{args.estimate.stem} on {args.dataset.absolute().name}", evaluated)
            written[args.page] = "curves and tables"
        if args.worst is not None:
            count = write_contact_sheet(args.worst, evaluated.worst, evaluated.report.names)
            written[args.worst] = f"the {count} worst of {len(evaluated.worst)} images with an error"
    except OSError as error:
        raise EdgeError(f"{error.filename}: cannot be written ({error.strerror}); give another place") from error
    except ValueError as error:
        raise UsageError(str(error)) from error
    return written
