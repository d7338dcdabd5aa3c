"""Images of a dataset as tasks of Label Studio, with what a model saw as suggestions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from edge.dataset.folder import IMAGES, DatasetFolder, read_text, refuse, write_whole
from edge.errors import FormatError, UsageError
from pipeline.dataset.label_studio import label_config, make_task
from pipeline.dataset.labels import Box, read_labels
from pipeline.dataset.record import ImageRecord

CONFIG = "label_config.xml"
DEFAULT_CLASS = "ailanthus"


@dataclass(frozen=True, slots=True)
class TaskRules:
    """url: what stands before an image's name in a task. everything: also images that have labels.

    predictions: a folder of `<image>.txt`, lines `class cx cy w h confidence`, by the rows of classes.txt.
    """

    url: str = ""
    everything: bool = False
    predictions: Path | None = None
    model: str = ""
    least_confidence: float = 0.25
    classes: tuple[str, ...] = ()


class TasksReport(msgspec.Struct):
    """suggestions: boxes of the model."""

    tasks: int
    with_suggestions: int
    suggestions: int
    without_prediction: int
    files: tuple[str, ...]


def write_tasks(dataset: DatasetFolder, output: Path, rules: TaskRules) -> TasksReport:
    """`output` (JSON to import), and the labelling interface beside it. FormatError for predictions that are none."""
    classes = list(rules.classes or dataset.classes or (DEFAULT_CLASS,))
    if dataset.classes and rules.classes and list(rules.classes) != dataset.classes:
        raise UsageError(f"--class: the dataset has its classes already: {', '.join(dataset.classes)}")
    records = [r for r in dataset.records if rules.everything or not dataset.label_path(r).exists()]
    suggested = {record.image: _suggested(record, rules, classes) for record in records}
    url = rules.url or f"/data/local-files/?d={dataset.folder.absolute().name}/{IMAGES}/"
    tasks = []
    for record in records:
        boxes = suggested[record.image]
        suggestions: dict[str, Any] = {}
        if boxes is not None:
            size = (record.width_px, record.height_px)
            suggestions = {"size_px": size, "boxes": boxes, "classes": classes, "model": rules.model or "model"}
        tasks.append(make_task(url + record.image, _about(record), **suggestions))
    write_whole(output, msgspec.json.format(msgspec.json.encode(tasks), indent=1) + b"\n")
    write_whole(output.with_name(CONFIG), label_config(classes).encode())
    found = [boxes for boxes in suggested.values() if boxes is not None]
    return TasksReport(
        tasks=len(tasks),
        with_suggestions=sum(1 for boxes in found if boxes),
        suggestions=sum(map(len, found)),
        without_prediction=len(tasks) - len(found) if rules.predictions else 0,
        files=(str(output), str(output.with_name(CONFIG))),
    )


def _about(record: ImageRecord) -> dict[str, Any]:
    return {"site": record.site, "source": record.source, "session": record.session}


def _suggested(record: ImageRecord, rules: TaskRules, classes: list[str]) -> list[Box] | None:
    """None where the model has not looked."""
    if rules.predictions is None:
        return None
    if not rules.predictions.is_dir():
        raise FormatError(f"{rules.predictions}: no such folder; give one with a .txt for each image")
    path = rules.predictions / f"{record.stem}.txt"
    if not path.exists():
        return None
    found = read_labels(read_text(path), str(path), len(classes), predictions=True)
    refuse(found.problems)
    return [box for box in found.boxes if box.confidence >= rules.least_confidence]
