"""The card of a model: from which data, how, with what, how good, and what may be done with it."""

from __future__ import annotations

import csv
import hashlib
import io
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from edge.dataset.folder import DatasetFolder, read_text
from edge.dataset.image import digest
from edge.errors import FormatError
from pipeline.dataset.record import SPLITS, ImageRecord

METRICS = {
    "precision": "metrics/precision(B)",
    "recall": "metrics/recall(B)",
    "map50": "metrics/mAP50(B)",
    "map50_95": "metrics/mAP50-95(B)",
}


class DataFacts(msgspec.Struct):
    """What was trained with. sha256: over the bytes of images and labels and their splits."""

    dataset: str
    sha256: str
    images: dict[str, int]
    boxes: dict[str, int]
    sites: dict[str, list[str]]
    sources: dict[str, int]
    licences: dict[str, int]
    non_commercial: int


class ModelCard(msgspec.Struct):
    """`card.json`. metrics: on the validation split, of the epoch with the best mAP50-95, as the trainer counts."""

    model: str
    model_sha256: str
    classes: list[str]
    input: list[Any]
    output: list[Any]
    opset: int
    data: DataFacts
    recipe: dict[str, Any]
    versions: dict[str, str]
    metrics: dict[str, float]
    trained_utc: str
    software: str
    terms: str


def data_facts(dataset: DatasetFolder) -> DataFacts:
    """Of the labelled images in the splits. FormatError for labels that are none."""
    pairs = list(zip(dataset.records, dataset.boxes(), strict=True))
    used = [(record, boxes) for record, boxes in pairs if record.split in SPLITS and boxes is not None]
    records = [record for record, _ in used]
    return DataFacts(
        dataset=dataset.folder.absolute().name,
        sha256=_digest(dataset, records),
        images={split: sum(r.split == split for r in records) for split in SPLITS},
        boxes={split: sum(len(b) for r, b in used if r.split == split) for split in SPLITS},
        sites={split: sorted({r.site for r in records if r.split == split and r.site}) for split in SPLITS},
        sources=dict(Counter(str(r.source) for r in records)),
        licences=dict(Counter(r.licence or "own" for r in records)),
        non_commercial=sum(r.non_commercial for r in records),
    )


def read_metrics(results: Path) -> dict[str, float]:
    """From the trainer's results.csv. FormatError when it is none."""
    table = csv.DictReader(io.StringIO(read_text(results)))
    rows = [{key.strip(): value for key, value in row.items() if key} for row in table]
    try:
        best = max(rows, key=lambda row: float(row[METRICS["map50_95"]]))
        return {"epoch": float(best["epoch"]), **{name: float(best[column]) for name, column in METRICS.items()}}
    except (KeyError, ValueError) as error:
        raise FormatError(f"{results}: not what the trainer writes ({error})") from error


def attribution_csv(records: Iterable[ImageRecord]) -> str:
    """Who made the photos: goes wherever the photos go."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(("image", "licence", "attribution", "url"))
    rows.writerows((r.image, r.licence, r.attribution, r.url) for r in records if r.attribution)
    return out.getvalue()


def markdown(card: ModelCard) -> str:
    """For people."""
    data, metrics = card.data, card.metrics
    score = ", ".join(f"{name} {metrics[name]:.3f}" for name in METRICS)
    lines = [
        f"# {card.model}",
        "",
        f"Detects {', '.join(card.classes)}. Input {_shape(card.input)}, output {_shape(card.output)}, ONNX opset "
        f"{card.opset}.",
        f"SHA-256 `{card.model_sha256}`. Trained {card.trained_utc} with {card.software}.",
        "",
        "| split | images | boxes | sites |",
        "| --- | --- | --- | --- |",
        *(f"| {s} | {data.images[s]} | {data.boxes[s]} | {', '.join(data.sites[s]) or '-'} |" for s in SPLITS),
        "",
        f"Data `{data.dataset}`, SHA-256 `{data.sha256}`; sources {_counts(data.sources)}; licences "
        f"{_counts(data.licences)}; {data.non_commercial} images for non-commercial use only. Who made the photos: "
        "`attribution.csv`.",
        "",
        f"On the validation split, epoch {metrics['epoch']:.0f}, as the trainer counts: {score}. It chose the weights "
        "by that split; what counts is the test split, with `mapforest evaluate`.",
        "",
        f"Recipe: {', '.join(f'{key} {value}' for key, value in card.recipe.items())}.",
        f"Versions: {', '.join(f'{key} {value}' for key, value in card.versions.items())}.",
        "",
        card.terms,
    ]
    return "\n".join(lines) + "\n"


def _digest(dataset: DatasetFolder, records: Sequence[ImageRecord]) -> str:
    lines = sorted(f"{r.split} {r.sha256} {digest(dataset.label_path(r).read_bytes())}\n" for r in records)
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def _shape(values: Sequence[Any]) -> str:
    return " x ".join(map(str, values))


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())
