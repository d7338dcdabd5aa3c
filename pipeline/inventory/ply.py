"""Maps as PLY (Turk 1994): ascii and binary, points read a part at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.inventory.errors import InventoryError
from pipeline.inventory.source import AT_ONCE, Part, check_extent

_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True, slots=True)
class _Header:
    """form: as in the file. point: of one vertex. begins: byte of the first one."""

    form: str
    count: int
    point: np.dtype[np.void]
    begins: int


class PlyMap:
    """The vertices of a PLY file that begins with them, as every scanner's does."""

    crs = None
    voxel_m = 0.0

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._header = _read_header(path)
            self.count = self._header.count
            low, high = self._extent()
        except (OSError, ValueError, KeyError) as error:
            raise InventoryError(f"{path}: cannot be read as PLY ({error}); copy it, or export it again") from error
        if self.count == 0:
            raise InventoryError(f"{path}: has no points")
        check_extent(path, low, high)
        self.origin_m = np.floor(low)
        self.bounds_m = np.array([low, high])[:, :2] - self.origin_m[:2]

    @property
    def name(self) -> str:
        """Of the file."""
        return self._path.name

    def placed(self, xyz_m: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """In the coordinates of the file."""
        return np.asarray(xyz_m + self.origin_m)

    def parts(self) -> Iterator[Part]:
        """All points, in the order of the file. InventoryError where it breaks off."""
        for xyz in self._points():
            yield Part((xyz - self.origin_m).astype(np.float32), np.zeros(len(xyz), np.bool_))

    def _extent(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for xyz in self._points():
            low, high = np.fmin(low, xyz.min(axis=0)), np.fmax(high, xyz.max(axis=0))
        return low, high

    def _points(self) -> Iterator[npt.NDArray[np.float64]]:
        read = 0
        for points in self._ascii() if self._header.form == "ascii" else self._binary():
            read += len(points)
            yield points
        if read < self._header.count:
            raise InventoryError(f"{self._path}: breaks off after {read:,} of {self._header.count:,} points")

    def _binary(self) -> Iterator[npt.NDArray[np.float64]]:
        left, point = self._header.count, self._header.point
        with self._path.open("rb") as file:
            file.seek(self._header.begins)
            while left:
                some = np.fromfile(file, point, min(left, AT_ONCE))
                if not len(some):
                    return
                left -= len(some)
                yield np.column_stack([some[axis].astype(np.float64) for axis in "xyz"])

    def _ascii(self) -> Iterator[npt.NDArray[np.float64]]:
        columns = [(self._header.point.names or ()).index(axis) for axis in "xyz"]
        with self._path.open("rb") as file:
            file.seek(self._header.begins)
            lines = islice(file, self._header.count)
            while some := list(islice(lines, AT_ONCE // 10)):
                yield np.loadtxt(some, usecols=columns, ndmin=2)


def _read_header(path: Path) -> _Header:
    """ValueError, KeyError where it is not as PLY says."""
    with path.open("rb") as file:
        if file.readline().strip() != b"ply":
            raise ValueError("it does not begin with `ply`")
        form, count, fields, inside = "", -1, [], False
        for line in islice(file, 200):
            match line.decode("ascii").split():
                case ["format", form, _]:
                    pass
                case ["element", "vertex", number]:
                    count, inside = int(number), True
                case ["element", name, number]:
                    if count < 0 and int(number):
                        raise ValueError(f"`{name}` stands before `vertex`")
                    inside = False
                case ["property", kind, name] if inside:
                    fields.append((name, _ORDERS[form] + _TYPES[kind]))
                case ["end_header"]:
                    break
        else:
            raise ValueError("its header does not end")
        if count < 0 or not {"x", "y", "z"} <= {name for name, _ in fields}:
            raise ValueError("it has no vertices with x, y and z")
        return _Header(form, count, np.dtype(fields), file.tell())
