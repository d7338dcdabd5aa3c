"""From a dataset to a model the payload runs: lists, recipe, the trainer, ONNX, card."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import msgspec

from edge import __version__
from edge.dataset.card import ModelCard, attribution_csv, data_facts, markdown, read_metrics
from edge.dataset.folder import DatasetFolder, write_whole
from edge.dataset.image import digest
from edge.dataset.recipe import Recipe, configuration, export_arguments, yaml_text
from edge.dataset.trainer import AGPL, Described, Trainer
from edge.dataset.yolo import write_lists
from edge.errors import EdgeError, FormatError, UsageError
from pipeline.dataset.record import SPLITS

TRAINED = "trained"
"""A mark: the trainer has been through all epochs."""
MODEL, CARD, RECIPE, LOG = "model.onnx", "card.json", "recipe.yaml", "train.log"


@dataclass(frozen=True, slots=True)
class TrainingTask:
    """run: a folder for everything that comes out. more: key=value for the trainer. resume: go on where it stopped."""

    run: Path
    recipe: Recipe = field(default_factory=Recipe)
    more: Sequence[str] = ()
    resume: bool = False


def train(dataset: DatasetFolder, task: TrainingTask, trainer: Trainer) -> ModelCard:
    """Takes hours. UsageError for a dataset that is not ready, EdgeError when the trainer fails."""
    run = task.run.absolute()
    weights = run / "train" / "weights"
    arguments = _arguments(run, weights / "last.pt", resume=task.resume)
    told = prepare(dataset, task)
    trainer.run(["settings", "sync=False"], run, run / LOG)  # it reports nothing to its makers
    if not (run / TRAINED).exists():
        trainer.run(arguments, run, run / LOG)
        _made(weights / "best.pt", run)
        (run / TRAINED).touch()
    trainer.run(export_arguments(weights / "best.pt", told), run, run / LOG)
    shutil.copyfile(_made(weights / "best.onnx", run), run / MODEL)
    described = trainer.describe(run, run / MODEL)
    _refuse_strange(described, dataset.classes, told["imgsz"])
    return _write_card(dataset, run, told, described)


def _arguments(run: Path, last: Path, *, resume: bool) -> list[str]:
    if not resume:
        return [f"cfg={run / RECIPE}"]
    if not last.exists():
        raise UsageError(f"--resume: there is no {last}; remove {run} if it is there, and begin without --resume")
    return ["train", "resume=True", f"model={last}"]


def _made(path: Path, run: Path) -> Path:
    if not path.exists():
        raise EdgeError(f"the trainer left no {path}; see {run / LOG}")
    return path


def prepare(dataset: DatasetFolder, task: TrainingTask) -> dict[str, Any]:
    """Lists, data.yaml and recipe in the run's folder; what the trainer will be told."""
    _refuse_unready(dataset)
    run = task.run.absolute()
    if run.exists() and any(run.iterdir()) and not task.resume:
        raise UsageError(f"{run}: is there already and not empty; give a new --output, or go on with --resume")
    run.mkdir(parents=True, exist_ok=True)
    told = configuration(task.recipe, run, task.more)
    write_lists(dataset, dataset.records, run)
    write_whole(run / RECIPE, yaml_text(told).encode())
    return told


def _refuse_unready(dataset: DatasetFolder) -> None:
    facts = data_facts(dataset)
    if not dataset.classes:
        raise UsageError(f"{dataset.folder}: has no classes.txt: bring labels in with `mapforest dataset labels`")
    for split in SPLITS[:2]:
        if not facts.images[split]:
            raise UsageError(
                f"{dataset.folder}: no labelled image is in {split}; label some, then `mapforest dataset split`"
            )
    if not facts.boxes["train"]:
        raise UsageError(f"{dataset.folder}: there is no box in train; there is nothing to learn")


def _refuse_strange(described: Described, classes: Sequence[str], size_px: int) -> None:
    """What the payload would refuse in the field, it is better to learn at home."""
    expected = [1, 3, size_px, size_px]
    if described.input != expected:
        raise FormatError(f"the exported model takes {described.input}, expected {expected}")
    names = str(dict(enumerate(classes)))
    if described.metadata.get("names") != names:
        raise FormatError(f"the exported model names {described.metadata.get('names')}, expected {names}")


def _write_card(dataset: DatasetFolder, run: Path, told: dict[str, Any], described: Described) -> ModelCard:
    card = ModelCard(
        model=MODEL,
        model_sha256=digest((run / MODEL).read_bytes()),
        classes=list(dataset.classes),
        input=described.input,
        output=described.output,
        opset=described.opset,
        data=data_facts(dataset),
        recipe={key: value for key, value in told.items() if key not in ("data", "project", "name", "exist_ok")},
        versions=described.versions,
        metrics=read_metrics(run / "train" / "results.csv"),
        trained_utc=f"{datetime.now(timezone.utc):%Y-%m-%dT%H:%M:%SZ}",
        software=f"mapforest {__version__}",
        terms=AGPL,
    )
    write_whole(run / CARD, msgspec.json.format(msgspec.json.encode(card), indent=2) + b"\n")
    write_whole(run / "card.md", markdown(card).encode())
    write_whole(run / "attribution.csv", attribution_csv(dataset.records).encode())
    return card
