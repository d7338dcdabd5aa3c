"""Vertices of a PLY file (Turk 1994), text or binary, as far as their places go; a batch at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4"},
    **{"double": "f8", "float64": "f8"},
}
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
_LONGEST = 200
"""Lines of a header."""


class PlyError(ValueError):
    """Names the file, and what is wrong with it."""


@dataclass(frozen=True, slots=True)
class _Header:
    order: str
    count: int
    fields: list[tuple[str, str]]


def batches(path: Path, at_once: int) -> Iterator[Array]:
    """(n, 3) places, those that are numbers. PlyError."""
    try:
        with path.open("rb") as file:
            header = _read_header(path, list(_header_lines(file)))
            rows = _text if not header.order else _binary
            yield from filter(len, rows(path, header, file.tell(), at_once))
    except OSError as error:
        raise PlyError(f"{path}: cannot be read ({error.strerror or error})") from error


def _header_lines(file: BinaryIO) -> Iterator[bytes]:
    for _ in range(_LONGEST):
        line = file.readline(400)
        if not line or line.strip() == b"end_header":
            return
        yield line


def _binary(path: Path, header: _Header, start: int, at_once: int) -> Iterator[Array]:
    kind = np.dtype([(name, header.order + code) for name, code in header.fields])
    with path.open("rb") as file:
        file.seek(start)
        for first in range(0, header.count, at_once):
            wanted = min(at_once, header.count - first)
            raw = file.read(wanted * kind.itemsize)
            if len(raw) < wanted * kind.itemsize:
                raise PlyError(f"{path}: ends after {first + len(raw) // kind.itemsize:,} of {header.count:,} points")
            found = np.frombuffer(raw, kind)
            yield _sound(np.column_stack([found[axis].astype(np.float64) for axis in "xyz"]))


def _text(path: Path, header: _Header, start: int, at_once: int) -> Iterator[Array]:
    columns = [[name for name, _ in header.fields].index(axis) for axis in "xyz"]
    with path.open("rb") as file:
        file.seek(start)
        for first in range(0, header.count, at_once):
            wanted = min(at_once, header.count - first)
            lines = list(islice(file, wanted))
            if len(lines) < wanted:
                raise PlyError(f"{path}: ends after {first + len(lines):,} of {header.count:,} points")
            try:
                yield _sound(np.loadtxt(lines, usecols=columns, ndmin=2))
            except (ValueError, IndexError) as error:
                raise PlyError(f"{path}: vertex {first:,} or one after it is not what the header says") from error


def _sound(xyz: Array) -> Array:
    return np.asarray(xyz[np.isfinite(xyz).all(axis=1)])


def _read_header(path: Path, lines: list[bytes]) -> _Header:
    words = [line.decode("ascii", "replace").split() for line in lines]
    if not words or words[0] != ["ply"]:
        raise PlyError(f"{path}: no PLY file, it does not begin with 'ply'")
    order = next((row[1] for row in words if row[:1] == ["format"] and len(row) > 1), "")
    elements = [k for k, row in enumerate(words) if row[:1] == ["element"]]
    if order not in _ORDERS or not elements or words[elements[0]][1:2] != ["vertex"]:
        raise PlyError(f"{path}: a PLY file whose first element is 'vertex' is expected, text or binary")
    end = elements[1] if len(elements) > 1 else len(words)
    properties = [row for row in words[elements[0] + 1 : end] if row[:1] == ["property"]]
    if any(len(row) != 3 or row[1] not in _TYPES for row in properties):
        raise PlyError(f"{path}: its vertices have lists or types that PLY does not know")
    fields = [(row[2], _TYPES[row[1]]) for row in properties]
    if not {"x", "y", "z"} <= {name for name, _ in fields}:
        raise PlyError(f"{path}: its vertices have no x, y and z")
    return _Header(_ORDERS[order], _count(path, words[elements[0]]), fields)


def _count(path: Path, row: list[str]) -> int:
    if len(row) != 3 or not row[2].isdecimal():
        raise PlyError(f"{path}: its header does not say how many vertices there are")
    return int(row[2])
