"""What Label Studio exports: a folder or ZIP of YOLO labels, or JSON, as what each person marked in each image."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from edge.dataset.folder import CLASSES, IMAGES, LABELS, parse_classes
from edge.dataset.image import ENDINGS
from edge.errors import FormatError
from pipeline.dataset.errors import DatasetError
from pipeline.dataset.label_studio import Marked, read_export
from pipeline.dataset.labels import read_labels

Read = Callable[[], bytes]


@dataclass(frozen=True, slots=True)
class Export:
    """classes: in the order of the export. images: stem -> how to read one that came along."""

    classes: tuple[str, ...]
    marked: tuple[Marked, ...]
    images: Mapping[str, tuple[str, Read]]


def open_export(path: Path, images: Path | None = None) -> Export:
    """Read all labels, and no image yet. images: a folder with pictures that the export lacks. FormatError."""
    for given in filter(None, (path, images)):
        if not given.exists():
            raise FormatError(f"{given}: there is no such file or folder")
    try:
        files = _files(path)
    except (OSError, zipfile.BadZipFile) as error:
        raise FormatError(f"{path}: cannot be opened ({error})") from error
    more = _pictures(_tree(images), "") if images is not None else {}
    root = _root(files)
    if root is not None:
        found = _yolo(files, root, str(path))
        return Export(found.classes, found.marked, more | dict(found.images))
    documents = [name for name in files if name.endswith(".json")]
    if len(documents) != 1:
        raise FormatError(
            f"{path}: neither a YOLO export (no {CLASSES} in it) nor one file of JSON; export from Label Studio as "
            "YOLO or JSON"
        )
    try:
        marked = tuple(read_export(files[documents[0]](), documents[0]))
    except DatasetError as error:
        raise FormatError(str(error)) from error
    names = dict.fromkeys(name for one in marked for name, _ in one.boxes)
    return Export(tuple(names), marked, more)


def _files(path: Path) -> dict[str, Read]:
    """Relative name -> how to read it."""
    if path.is_dir():
        return _tree(path)
    if zipfile.is_zipfile(path):
        archive = zipfile.ZipFile(path)
        return {info.filename: _member(archive, info) for info in archive.infolist() if not info.is_dir()}
    return {path.name: path.read_bytes}


def _tree(folder: Path) -> dict[str, Read]:
    return {str(p.relative_to(folder).as_posix()): p.read_bytes for p in sorted(folder.rglob("*")) if p.is_file()}


def _member(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> Read:
    return lambda: archive.read(info)


def _root(files: Mapping[str, Read]) -> str | None:
    """The folder in which classes.txt lies, with its slash; None for what is no YOLO export."""
    found = [name for name in files if PurePosixPath(name).name == CLASSES]
    return min(found, key=lambda name: (name.count("/"), name)).removesuffix(CLASSES) if found else None


def _yolo(files: Mapping[str, Read], root: str, where: str) -> Export:
    classes = parse_classes(_text(files[root + CLASSES](), f"{where}: {CLASSES}"), CLASSES)
    return Export(tuple(classes), tuple(_labels(files, root, classes)), _pictures(files, f"{root}{IMAGES}/"))


def _labels(files: Mapping[str, Read], root: str, classes: list[str]) -> Iterator[Marked]:
    """A folder below labels/ is a person (split_labelers), or a split: an image is in one of those only."""
    for name, read in files.items():
        relative = PurePosixPath(name.removeprefix(root))
        if not name.startswith(root) or relative.parts[0] != LABELS or relative.suffix != ".txt":
            continue
        found = read_labels(_text(read(), str(relative)), str(relative), len(classes))
        yield Marked(
            image=relative.stem,
            labeler="/".join(relative.parts[1:-1]),
            boxes=tuple((classes[box.class_id], box) for box in found.boxes),
            problems=found.problems,
            clipped=found.clipped,
            polygons=found.polygons,
        )


def _pictures(files: Mapping[str, Read], below: str) -> dict[str, tuple[str, Read]]:
    names = [PurePosixPath(name) for name in files if name.startswith(below)]
    return {name.stem: (name.name, files[str(name)]) for name in names if name.suffix.lower() in ENDINGS}


def _text(data: bytes, where: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"{where}: byte {error.start} is not UTF-8") from error
