"""A dataset as trainers of the YOLO family take it: data.yaml and a list of images for each split."""

from __future__ import annotations

import json
import shutil
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from edge.dataset.folder import IMAGES, DatasetFolder, write_whole
from edge.errors import EdgeError, UsageError
from pipeline.dataset.record import SPLITS, ImageRecord, Split

DATA = "data.yaml"


def write_lists(dataset: DatasetFolder, records: Sequence[ImageRecord], folder: Path) -> dict[Split, int]:
    """train.txt, val.txt, test.txt and data.yaml, of the images that somebody has looked at: the others would count as
    empty. Paths are relative where the dataset is that folder, absolute otherwise."""
    counts: dict[Split, int] = {}
    images = "./images" if folder == dataset.folder else str((dataset.folder / IMAGES).absolute())
    for split in SPLITS:
        chosen = [r.image for r in records if r.split == split and dataset.label_path(r).exists()]
        counts[split] = len(chosen)
        write_whole(folder / f"{split}.txt", "".join(f"{images}/{name}\n" for name in chosen).encode())
    lines = [f"{split}: {split}.txt" for split in SPLITS if counts[split] or split != "test"]
    # A JSON string is a YAML string in double quotes.
    names = [f"  {number}: {json.dumps(name, ensure_ascii=False)}" for number, name in enumerate(dataset.classes)]
    write_whole(folder / DATA, ("\n".join([*lines, "names:", *names]) + "\n").encode())
    return counts


@dataclass(frozen=True, slots=True)
class Part:
    """Which images; empty: any."""

    splits: Collection[str] = ()
    sites: Collection[str] = ()
    sources: Collection[str] = ()
    unlabelled: bool = False
    """Also images nobody has looked at."""

    def has(self, record: ImageRecord) -> bool:
        """Whether it is in this part."""
        asked = ((self.splits, record.split), (self.sites, record.site), (self.sources, record.source))
        return all(not wanted or value in wanted for wanted, value in asked)


class ExportReport(msgspec.Struct):
    """What was copied."""

    folder: str
    images: int
    labelled: int


def export(dataset: DatasetFolder, output: Path, part: Part) -> ExportReport:
    """A dataset of its own from a part of another: what the evaluation of a test split takes. UsageError, EdgeError."""
    records = [r for r in dataset.records if part.has(r) and (part.unlabelled or dataset.label_path(r).exists())]
    if not records:
        raise UsageError("no image is in this part of the dataset; `mapforest dataset statistics` shows what there is")
    if output.exists() and any(output.iterdir()):
        raise UsageError(f"{output}: is there already and not empty; give a new folder")
    made = DatasetFolder.make(output)
    made.classes, made.records = list(dataset.classes), records
    labelled = 0
    try:
        for record in records:
            shutil.copyfile(dataset.image_path(record), made.image_path(record))
            if dataset.label_path(record).exists():
                shutil.copyfile(dataset.label_path(record), made.label_path(record))
                labelled += 1
    except OSError as error:
        raise EdgeError(f"{output}: {error}") from error
    made.save()
    write_lists(made, records, output)
    return ExportReport(str(output), len(records), labelled)
