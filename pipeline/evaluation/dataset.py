"""Labelled images as YOLO and Label Studio write them.

images/     JPEG or PNG, in folders of any depth
labels/     beside each image a text of the same name; a line an object: class cx cy w h, of the image's size
classes.txt a line a class; its number is its row
sites.csv   image, site (optional): what was photographed in one place, or by one session
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.evaluation.errors import DatasetError

Array = npt.NDArray[np.float64]
IMAGES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp"})
NOWHERE = "no site"
_SLACK = 0.02
"""Share of the image that a box may reach over its edge, by rounding or a hasty hand; it is clipped."""
_BOX, _SURE_BOX, _POLYGON = 5, 6, 7
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
    """None: nothing. predicted: with the confidence as a sixth number, as YOLO saves its results."""
    rows = []
    if path is not None:
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise DatasetError(f"{path}: cannot be read ({error})") from error
        for number, line in enumerate(lines, 1):
            if line.strip():
                rows.append(_row(line.split(), classes, f"{path}:{number}", predicted=predicted))
    values = np.array(rows, np.float64).reshape(-1, 6)
    return Boxes(values[:, 1:5], values[:, 0].astype(np.int64), values[:, 5])


def _row(words: Sequence[str], classes: int, where: str, *, predicted: bool) -> tuple[float, ...]:
    try:
        number, *values = map(float, words)
    except ValueError:
        number, values = math.nan, []
    if not all(map(math.isfinite, (number, *values))):
        raise DatasetError(f"{where}: found {' '.join(words)[:60]!r}, expected numbers")
    if not 0 <= number < classes or number % 1:
        raise DatasetError(f"{where}: class {words[0]}, expected one of the {classes} in classes.txt, counted from 0")
    sure = 1.0
    if predicted:
        if len(words) != _SURE_BOX:
            raise DatasetError(f"{where}: {len(words)} numbers, expected 6: class cx cy w h confidence")
        *values, sure = values
    box = _outline(values, where)
    if min(box) < -_SLACK or max(box) > 1.0 + _SLACK:
        raise DatasetError(f"{where}: reaches far out of the image; expected shares of its width and height, 0 to 1")
    left, top, right, bottom = (min(max(value, 0.0), 1.0) for value in box)
    if right <= left or bottom <= top:
        raise DatasetError(f"{where}: has no size; take the line out")
    return number, left, top, right, bottom, sure


def _outline(values: Sequence[float], where: str) -> tuple[float, float, float, float]:
    """Of a box by centre and size, or around a polygon."""
    if len(values) == _BOX - 1:
        cx, cy, width, height = values
        return cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2
    if len(values) >= _POLYGON - 1 and len(values) % 2 == 0:
        return min(values[::2]), min(values[1::2]), max(values[::2]), max(values[1::2])
    raise DatasetError(f"{where}: {1 + len(values)} numbers, expected 5 (class cx cy w h) or a polygon's 7, 9, 11, ...")


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
