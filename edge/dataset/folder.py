"""A dataset on the disk.

images/          the pictures
labels/          <name>.txt for each that somebody looked at, empty where nothing is there
classes.txt      names of the classes, a row each; absent before the first labels
manifest.jsonl   a line an image: where it is from, what may be done with it, which split it is in
sites.csv        image, site, source, session, split: for `mapforest evaluate`, and for spreadsheets
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from edge.dataset.image import ENDINGS, ImageFacts, image_facts
from edge.errors import EdgeError, FormatError
from pipeline.dataset.labels import Box, Labels, format_labels, read_labels
from pipeline.dataset.record import ImageRecord

IMAGES, LABELS, CLASSES, MANIFEST, SITES = "images", "labels", "classes.txt", "manifest.jsonl", "sites.csv"
SITES_COLUMNS = ("image", "site", "source", "session", "split")


class DatasetFolder:
    """The records are in memory; labels are read when asked for. `save` writes what changed."""

    def __init__(self, folder: Path, records: list[ImageRecord], classes: list[str]) -> None:
        self.folder = folder
        self.records = records
        self.classes = classes

    @classmethod
    def open(cls, folder: Path) -> DatasetFolder:
        """A dataset, also a YOLO folder of somebody else's: its images are looked at then. FormatError."""
        if not (folder / IMAGES).is_dir():
            raise FormatError(f"{folder}: not a dataset, there is no {IMAGES}/ in it; see `mapforest dataset --help`")
        records = _read_manifest(folder / MANIFEST) if (folder / MANIFEST).exists() else _look(folder)
        return cls(folder, records, read_classes(folder / CLASSES) if (folder / CLASSES).exists() else [])

    @classmethod
    def make(cls, folder: Path) -> DatasetFolder:
        """The dataset that is there, or a new one, to add to. EdgeError where it cannot be written."""
        made = cls.open(folder) if (folder / IMAGES).is_dir() else cls(folder, [], [])
        try:
            for name in (IMAGES, LABELS):
                (folder / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise EdgeError(f"{folder}: cannot be made ({error.strerror}); give another place with --output") from error
        made.save()  # also ends a last line that a power cut tore
        return made

    def image_path(self, record: ImageRecord) -> Path:
        """Of the picture."""
        return self.folder / IMAGES / record.image

    def label_path(self, record: ImageRecord) -> Path:
        """Of its labels, which need not be there."""
        return self.folder / LABELS / f"{record.stem}.txt"

    def labels(self, record: ImageRecord) -> Labels | None:
        """None where nobody has looked."""
        path = self.label_path(record)
        if not path.exists():
            return None
        return read_labels(read_text(path), f"{LABELS}/{path.name}", len(self.classes))

    def boxes(self) -> list[tuple[Box, ...] | None]:
        """Of each image. FormatError names the first lines that are none."""
        found = [self.labels(record) for record in self.records]
        refuse([problem for one in found if one is not None for problem in one.problems])
        return [None if one is None else one.boxes for one in found]

    def add(self, record: ImageRecord, data: bytes) -> None:
        """A new picture, on the disk at once with its line in the manifest."""
        write_whole(self.image_path(record), data)
        self.records.append(record)
        with (self.folder / MANIFEST).open("ab") as file:
            file.write(msgspec.json.encode(record) + b"\n")

    def set_labels(self, record: ImageRecord, boxes: Iterable[Box]) -> None:
        """Write or replace them."""
        write_whole(self.label_path(record), format_labels(boxes).encode())

    def save(self) -> None:
        """Manifest, classes and sites, each whole or not at all."""
        write_whole(self.folder / MANIFEST, b"".join(msgspec.json.encode(one) + b"\n" for one in self.records))
        if self.classes:
            write_whole(self.folder / CLASSES, "".join(f"{name}\n" for name in self.classes).encode())
        write_whole(self.folder / SITES, sites_csv(self.records).encode())


def read_classes(path: Path) -> list[str]:
    """A name a row. FormatError for a row without one, or a name twice."""
    return parse_classes(read_text(path), str(path))


def parse_classes(text: str, where: str) -> list[str]:
    """The same of a text."""
    names = [name.strip() for name in text.rstrip().splitlines()]
    for number, name in enumerate(names, 1):
        if not name:
            raise FormatError(f"{where}:{number}: an empty row; rows are the numbers of classes, none may be empty")
        if name in names[: number - 1]:
            raise FormatError(f"{where}:{number}: {name!r} stands there twice")
    if not names:
        raise FormatError(f"{where}: names no class")
    return names


def read_text(path: Path) -> str:
    """UTF-8. FormatError for bytes that are not."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"{path}: cannot be read as text ({error})") from error


def sites_csv(records: Iterable[ImageRecord]) -> str:
    """With a heading. Images of no site have their source for one, so that it is told apart."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(SITES_COLUMNS)
    rows.writerows((r.image, r.site or r.source, r.source, r.session, r.split) for r in records)
    return out.getvalue()


def refuse(problems: Sequence[str], most: int = 10) -> None:
    """FormatError with the first of them, if there are any."""
    if problems:
        more = f"\n... and {len(problems) - most} more" if len(problems) > most else ""
        raise FormatError("\n".join(problems[:most]) + more)


def write_whole(path: Path, data: bytes) -> None:
    """A draft beside the file, put in its place when all is written. EdgeError."""
    draft = path.with_name(".draft")
    try:
        draft.write_bytes(data)
        draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise EdgeError(f"{path}: cannot be written ({error.strerror})") from error


def _read_manifest(path: Path) -> list[ImageRecord]:
    records: dict[str, ImageRecord] = {}
    lines = path.read_bytes().splitlines()
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            record = msgspec.json.decode(line, type=ImageRecord)
        except msgspec.MsgspecError as error:
            if number == len(lines):  # the power went while it was written: the same step adds the image again
                break
            raise FormatError(f"{path}:{number}: {error}") from error
        if "/" in record.image or record.image in ("", ".", ".."):
            raise FormatError(f"{path}:{number}: {record.image!r} is not the name of a file in {IMAGES}/")
        records[record.image] = record
    return list(records.values())


def _look(folder: Path) -> list[ImageRecord]:
    """Records of images that came without a manifest; the site from sites.csv, where that is."""
    sites: dict[str, str] = {}
    if (folder / SITES).exists():
        sites = {row[0]: row[1] for row in csv.reader(io.StringIO(read_text(folder / SITES))) if len(row) > 1}
    records = []
    for path in sorted((folder / IMAGES).iterdir()):
        if path.suffix.lower() in ENDINGS:
            facts = image_facts(path.read_bytes(), str(path))
            site = sites.get(path.name) or sites.get(path.stem) or ""
            records.append(record_of(path.name, facts, site=site))
    return records


def record_of(name: str, facts: ImageFacts, **fields: object) -> ImageRecord:
    """A record with what an image file says of itself."""
    return msgspec.convert({"image": name, **msgspec.to_builtins(facts), **fields}, ImageRecord)
