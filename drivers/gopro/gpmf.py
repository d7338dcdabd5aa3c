"""GPMF: the telemetry in a GoPro's own files, as nested keys.

A key is four characters, a type, the size of a structure, how many of them (big-endian), and the data, padded to four
bytes; type 0 holds other keys. SCAL divides what follows it in its stream. Written after the public description of the
format; docs/calibration.md says what of it is used.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.errors import ProtocolError

_HEAD = struct.Struct(">4sBBH")
_TYPES = {
    **{"b": ">i1", "B": ">u1", "s": ">i2", "S": ">u2", "l": ">i4", "L": ">u4", "j": ">i8", "J": ">u8"},
    **{"f": ">f4", "d": ">f8"},
}
_NESTED = 0


@dataclass(frozen=True, slots=True)
class Key:
    """name: four characters. kind: the type's letter, empty for nested keys. size: of one structure, in bytes."""

    name: str
    kind: str
    size: int
    count: int
    data: bytes

    @property
    def text(self) -> str:
        """Of a key of characters."""
        return self.data.rstrip(b"\0").decode("latin-1")

    @property
    def numbers(self) -> npt.NDArray[np.float64]:
        """(count, values in a structure). ProtocolError for a type that is no number."""
        if self.kind not in _TYPES:
            raise ProtocolError(f"GPMF: {self.name} is of type {self.kind!r}, which is no number")
        values = np.frombuffer(self.data, _TYPES[self.kind]).astype(np.float64)
        return values.reshape(self.count, -1) if self.count else np.empty((0, 0))


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """One kind of measurement in one payload. values: (n, axes), scaled.

    first_us: the camera's clock at the first of them; total: samples so far, these included. None: not told.
    """

    name: str
    values: npt.NDArray[np.float64]
    first_us: int | None
    total: int | None


def keys(data: bytes) -> Iterator[Key]:
    """The keys that follow each other. ProtocolError where one does not fit into the rest."""
    at = 0
    while at + _HEAD.size <= len(data):
        name, kind, size, count = _HEAD.unpack_from(data, at)
        if name == b"\0\0\0\0":
            return
        begin, length = at + _HEAD.size, size * count
        if begin + length > len(data):
            raise ProtocolError(f"GPMF: {name!r} at byte {at} says {length} bytes, {len(data) - begin} are left")
        letter = "" if kind == _NESTED else chr(kind)
        yield Key(name.decode("latin-1"), letter, size, count, data[begin : begin + length])
        at = begin + length + -length % 4


def samples(payload: bytes, names: frozenset[str]) -> list[Samples]:
    """The measurements of these names in a payload, of all devices. ProtocolError for a broken one."""
    found = []
    for device in keys(payload):
        if device.name == "DEVC":
            for stream in keys(device.data):
                if stream.name == "STRM" and (one := _samples(stream.data, names)) is not None:
                    found.append(one)
    return found


def _samples(stream: bytes, names: frozenset[str]) -> Samples | None:
    told = {key.name: key for key in keys(stream)}
    name = next((name for name in told if name in names), None)
    if name is None:
        return None
    values = told[name].numbers
    if "SCAL" in told and len(values):
        values = values / told["SCAL"].numbers.ravel()
    first, total = (int(told[key].numbers[0, 0]) if key in told else None for key in ("STMP", "TSMP"))
    return Samples(name, values, first, total)
