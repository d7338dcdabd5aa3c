"""Labelled images as YOLO and Label Studio write them.

images/     JPEG or PNG, in folders of any depth
labels/     beside each image a text of the same name; a line an object: class cx cy w h, of the image's size
classes.txt a line a class; its number is its row
sites.csv   image, site (optional): what was photographed in one place, or by one session
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.dataset.labels import Box, read_labels
from pipeline.evaluation.errors import DatasetError

Array = npt.NDArray[np.float64]
IMAGES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp"})
NOWHERE = "no site"
WITHOUT_CONFIDENCE = 5
"""Numbers of a line."""
_TOLD = 3


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """boxes: (n, 4) x_min, y_min, x_max, y_max as shares of the image's size. class_id: (n,). confidence: (n,), 1 of
    what a person drew."""

    boxes: Array
    class_id: npt.NDArray[np.int64]
    confidence: Array

    def __len__(self) -> int:
        return len(self.boxes)


@dataclass(frozen=True, slots=True, eq=False)
class LabelledImage:
    """name: its path below `images`, without the ending. path: None where only the labels are there."""

    name: str
    path: Path | None
    site: str
    truth: Boxes


@dataclass(frozen=True, slots=True, eq=False)
class Dataset:
    """notes: what had to be assumed."""

    folder: Path
    class_names: tuple[str, ...]
    images: tuple[LabelledImage, ...]
    notes: tuple[str, ...]

    @property
    def sites(self) -> tuple[str, ...]:
        """Each once."""
        return tuple(sorted({image.site for image in self.images}))


def read_dataset(folder: Path) -> Dataset:
    """DatasetError names the file, and the line where one is wrong."""
    if not folder.is_dir():
        raise DatasetError(f"{folder}: no such folder; give one with images/, labels/ and classes.txt")
    names = read_classes(folder / "classes.txt")
    labels = {_name(path, folder / "labels"): path for path in sorted((folder / "labels").rglob("*.txt"))}
    images = _images(folder / "images")
    chosen = images or dict.fromkeys(labels)
    if not chosen:
        raise DatasetError(f"{folder}: neither images/ nor labels/ has a file; give a dataset in YOLO's layout")
    sites, notes = _sites(folder / "sites.csv", chosen)
    held = tuple(
        LabelledImage(name, path, sites.get(name, NOWHERE), read_boxes(labels.get(name), len(names)))
        for name, path in chosen.items()
    )
    notes += _told("images without labels, taken as showing nothing", chosen.keys() - labels.keys())
    notes += _told("labels without an image, left out", labels.keys() - chosen.keys())
    return Dataset(folder, names, held, tuple(notes))


def read_classes(path: Path) -> tuple[str, ...]:
    """DatasetError where there is none."""
    try:
        names = tuple(line.strip() for line in path.read_text(encoding="utf-8").splitlines() if line.strip())
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"{path}: cannot be read ({error}); expected the name of a class on each line") from error
    if not names or len(set(names)) != len(names):
        raise DatasetError(f"{path}: expected the name of a class on each line, each once, found {list(names)[:5]}")
    return names


def read_boxes(path: Path | None, classes: int, *, predicted: bool = False) -> Boxes:
    """None: nothing. predicted: with the confidence as a sixth number, as YOLO saves its results.

    DatasetError for a line that is no box: figures over a part of the labels would say something else.
    """
    if path is None:
        return _boxes(())
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"{path}: cannot be read ({error})") from error
    if predicted and any(len(line.split()) == WITHOUT_CONFIDENCE for line in text.splitlines()):
        raise DatasetError(f"{path}: a box without a confidence; let YOLO save them too (`save_conf=True`)")
    labels = read_labels(text, str(path), classes, predictions=predicted)
    if labels.problems:
        more = f" (and {len(labels.problems) - 1} more)" if len(labels.problems) > 1 else ""
        raise DatasetError(labels.problems[0] + more)
    return _boxes(labels.boxes)


def _boxes(held: Sequence[Box]) -> Boxes:
    corners = np.array([box.corners for box in held], np.float64).reshape(-1, 4)
    ids = np.array([box.class_id for box in held], np.int64)
    return Boxes(corners, ids, np.array([box.confidence for box in held], np.float64))


def _images(folder: Path) -> dict[str, Path | None]:
    found: dict[str, Path | None] = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() in IMAGES:
            name = _name(path, folder)
            if name in found:
                raise DatasetError(f"{path}: another image has this name with another ending; rename one")
            found[name] = path
    return found


def _sites(path: Path, known: Mapping[str, object]) -> tuple[dict[str, str], list[str]]:
    """Site by image, and what has to be said."""
    if not path.exists():
        return {}, ["no sites.csv: nothing is told by site"]
    found: dict[str, str] = {}
    strange: list[str] = []
    for number, row in _rows(path):
        if len(row) < 2 or not row[0].strip() or not row[1].strip():
            raise DatasetError(f"{path}:{number}: expected an image and its site, separated by a comma")
        name = row[0].strip()
        name = name if name in known else Path(name).with_suffix("").as_posix()
        if name in known:
            found[name] = row[1].strip()
        elif (number, name.lower()) != (1, "image"):
            strange.append(name)
    return found, _told("images of sites.csv that are not there", strange)


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    with path.open(newline="", encoding="utf-8") as file:
        yield from ((number, row) for number, row in enumerate(csv.reader(file), 1) if row)


def _name(path: Path, folder: Path) -> str:
    return path.relative_to(folder).with_suffix("").as_posix()


def _told(what: str, names: Sequence[str] | set[str]) -> list[str]:
    if not names:
        return []
    some = sorted(names)[:_TOLD]
    return [f"{len(names)} {what}: {', '.join(some)}{', ...' if len(names) > _TOLD else ''}"]
