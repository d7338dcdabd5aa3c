"""What goes out of a dataset: tasks for Label Studio, and parts of it as datasets of their own."""

from __future__ import annotations

import argparse
from pathlib import Path

from edge.cli import exit_codes
from edge.cli.steps import Step, some, tell


def _tasks_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--output", type=Path, required=True, metavar="FILE", help="JSON to import into Label Studio")
    parser.add_argument("--all", action="store_true", help="also images that have labels")
    parser.add_argument(
        "--predictions", type=Path, metavar="DIR", help="a .txt for each image, lines `class cx cy w h confidence`"
    )
    parser.add_argument("--model", default="", metavar="NAME", help="whose predictions they are")
    parser.add_argument("--min-confidence", type=float, default=0.25, metavar="C", help="suggest only above")
    parser.add_argument("--class", dest="classes", action="append", default=[], metavar="NAME", help="of a new dataset")
    parser.add_argument(
        "--url", default="", metavar="PREFIX", help="of the images (default: Label Studio's local files, by the folder)"
    )


def _tasks(args: argparse.Namespace) -> int:
    from edge.dataset.folder import DatasetFolder
    from edge.dataset.tasks import TaskRules, write_tasks

    rules = TaskRules(args.url, args.all, args.predictions, args.model, args.min_confidence, tuple(args.classes))
    report = write_tasks(DatasetFolder.open(args.dataset), args.output, rules)
    suggested = f"; boxes suggested: {report.suggestions:,}, in {report.with_suggestions:,} of them"
    lines = [
        f"tasks: {report.tasks:,}{suggested if args.predictions else ''}",
        some(report.without_prediction, "images without a prediction"),
        f"  {report.files[0]}: import it into a project",
        f"  {report.files[1]}: the project's labelling interface (Settings > Labeling Interface > Code)",
        "" if args.url else f"  Label Studio has to serve {args.dataset.absolute().parent} as its local files",
    ]
    tell(args, report, lines)
    return exit_codes.GOOD if report.tasks else exit_codes.WARNINGS


def _export_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="a new folder")
    parser.add_argument("--split", nargs="+", default=[], choices=["train", "val", "test", "gap"], help="only these")
    parser.add_argument("--site", nargs="+", default=[], help="only these sites")
    parser.add_argument("--source", nargs="+", default=[], choices=["field", "inaturalist", "other"], help="only these")
    parser.add_argument("--unlabelled", action="store_true", help="also images nobody has looked at")


def _export(args: argparse.Namespace) -> int:
    from edge.dataset.folder import DatasetFolder
    from edge.dataset.yolo import Part, export

    part = Part(args.split, args.site, args.source, args.unlabelled)
    report = export(DatasetFolder.open(args.dataset), args.output, part)
    tell(args, report, [f"{report.folder}: {report.images:,} images, {report.labelled:,} with labels"])
    return exit_codes.GOOD


STEPS: dict[str, Step] = {
    "tasks": ("images to label, as tasks of Label Studio, with suggestions of a model", _tasks_options, _tasks),
    "export": ("a part of a dataset as one of its own, for YOLO trainers and the evaluation", _export_options, _export),
}
