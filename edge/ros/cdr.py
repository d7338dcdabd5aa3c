"""XCDR1 (OMG CDR), plain little endian as ROS 2 writes it; the reader also takes big endian.

Four bytes of header, then fields aligned to their own size counted from after the header; strings carry their
length with the closing NUL.
"""

from __future__ import annotations

import struct
from typing import Literal

from edge.errors import FormatError

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
NS_PER_S = 1_000_000_000


class CdrWriter:
    """Appends fields to one message."""

    def __init__(self) -> None:
        self._buffer = bytearray(LITTLE_ENDIAN)

    def pack(self, code: str, *values: float) -> CdrWriter:
        """Fields of one kind, `struct` code `code` (b B h H i I q Q f d), aligned once."""
        size = struct.calcsize("<" + code)
        self._buffer += bytes(-(len(self._buffer) - 4) % size)
        self._buffer += struct.pack(f"<{len(values)}{code}", *values)
        return self

    def time(self, stamp_ns: int) -> CdrWriter:
        """builtin_interfaces/Time."""
        sec, nanosec = divmod(stamp_ns, NS_PER_S)
        return self.pack("i", sec).pack("I", nanosec)

    def string(self, text: str) -> CdrWriter:
        """A string; NULs inside would end it early in C++ readers and are taken out."""
        raw = text.replace("\x00", "").encode("utf-8", "replace") + b"\x00"
        self.pack("I", len(raw))
        self._buffer += raw
        return self

    def header(self, stamp_ns: int, frame_id: str) -> CdrWriter:
        """std_msgs/Header."""
        return self.time(stamp_ns).string(frame_id)

    def octets(self, data: bytes | memoryview) -> CdrWriter:
        """uint8[]."""
        self.pack("I", len(data))
        self._buffer += data
        return self

    def finish(self) -> bytes:
        return bytes(self._buffer)


class CdrReader:
    """Takes fields off one message in order. FormatError when it ends early."""

    def __init__(self, data: bytes | memoryview) -> None:
        if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
            raise FormatError(f"not a CDR message: it begins with {bytes(data[:4]).hex(' ') or 'nothing'}")
        self._data = memoryview(data)
        self._order: Literal["<", ">"] = "<" if data[1] == 1 else ">"
        self._at = 4

    @property
    def byte_order(self) -> Literal["<", ">"]:
        """`<` or `>`."""
        return self._order

    def unpack(self, code: str, count: int = 1) -> tuple[float, ...]:
        """`count` fields of one floating-point kind."""
        values: tuple[float, ...] = self._take(code, count)
        return values

    def integer(self, code: str) -> int:
        """One integer field."""
        return int(self._take(code, 1)[0])

    def boolean(self) -> bool:
        return self.integer("B") != 0

    def time(self) -> int:
        """builtin_interfaces/Time in nanoseconds."""
        return self.integer("i") * NS_PER_S + self.integer("I")

    def string(self) -> str:
        raw = self.octets()
        return bytes(raw).rstrip(b"\x00").decode("utf-8", "replace")

    def header(self) -> tuple[int, str]:
        """std_msgs/Header: stamp in nanoseconds, frame."""
        return self.time(), self.string()

    def octets(self) -> memoryview:
        """uint8[], without a copy."""
        size = self.integer("I")
        if size > len(self._data) - self._at:
            raise FormatError(f"CDR message ends early: {size} bytes announced at byte {self._at} of {len(self._data)}")
        self._at += size
        return self._data[self._at - size : self._at]

    def length(self, least_bytes: int) -> int:
        """Length of a sequence whose elements take at least `least_bytes` each."""
        count = self.integer("I")
        if count * least_bytes > len(self._data) - self._at:
            raise FormatError(f"CDR message ends early: {count} elements announced at byte {self._at}")
        return count

    def structures(self, stride: int, lacking: int) -> tuple[memoryview, int]:
        """A sequence of structures `stride` bytes apart, the last one `lacking` bytes shorter: octets and count."""
        count = self.integer("I")
        size = max(count * stride - lacking, 0)
        if size > len(self._data) - self._at:
            raise FormatError(f"CDR message ends early: {count} structures of {stride} bytes announced")
        self._at += size
        return self._data[self._at - size : self._at], count

    def _take(self, code: str, count: int) -> tuple[float, ...]:
        layout = f"{self._order}{count}{code}"
        size = struct.calcsize(self._order + code)
        start = self._at + (-(self._at - 4) % size)
        if start + size * count > len(self._data):
            raise FormatError(f"CDR message ends early: {len(self._data)} bytes, {start + size * count} needed")
        self._at = start + size * count
        return struct.unpack_from(layout, self._data, start)
