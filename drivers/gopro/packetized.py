"""PES packets (ISO/IEC 13818-1, 2.4.3.6) put together from the payloads of transport packets."""

from __future__ import annotations

from dataclasses import dataclass

LIMIT = 4 << 20
"""Bytes. The largest keyframe of a 1080p webcam stream is a twentieth of this."""


@dataclass(frozen=True, slots=True)
class Pes:
    """One PES packet. data is empty and pts None when it was damaged."""

    data: bytes
    pts: int | None
    receive_ns: int


class PesAssembler:
    """Collects one PES packet at a time."""

    def __init__(self) -> None:
        self._parts: list[bytes] | None = None
        self._size = 0
        self._whole = 0
        self._broken = False
        self._receive_ns = 0

    @property
    def complete(self) -> bool:
        """All bytes that the header announced are there. Video usually announces none (length 0)."""
        return self._parts is not None and not self._broken and self._whole > 0 and self._size >= self._whole

    def start(self, payload: bytes, receive_ns: int) -> None:
        """Begin with the payload of a packet that has payload_unit_start set."""
        length = int.from_bytes(payload[4:6], "big") if len(payload) >= 6 else 0
        self._parts, self._size, self._broken = [payload], len(payload), False
        self._whole = length + 6 if length else 0
        self._receive_ns = receive_ns

    def append(self, payload: bytes) -> None:
        """Continue. Payload that belongs to no packet (its start was missed) goes."""
        if self._parts is None or self._broken:
            return
        self._parts.append(payload)
        self._size += len(payload)
        if self._size > LIMIT:
            self.break_off()

    def break_off(self) -> None:
        """A part is missing: what follows until the next start cannot be placed."""
        self._broken = True
        if self._parts is not None:
            self._parts = []

    def finish(self) -> Pes | None:
        """The packet collected so far; None when there is none."""
        parts, self._parts = self._parts, None
        if parts is None:
            return None
        if self._broken or self._size < self._whole:
            return Pes(b"", None, self._receive_ns)
        raw = b"".join(parts)
        return _read(raw[: self._whole] if self._whole else raw, self._receive_ns)


def _read(raw: bytes, receive_ns: int) -> Pes:
    damaged = Pes(b"", None, receive_ns)
    if len(raw) < 9 or raw[:3] != b"\x00\x00\x01" or raw[3] & 0xF0 != 0xE0 or raw[6] & 0xC0 != 0x80:
        return damaged
    start = 9 + raw[8]
    if start > len(raw) or not raw[7] & 0x80 or raw[8] < 5:
        return damaged
    pts = read_timestamp(raw[9:14])
    return damaged if pts is None else Pes(raw[start:], pts, receive_ns)


def read_timestamp(field: bytes) -> int | None:
    """33-bit PTS out of its five bytes; None when a marker bit is missing (table 2-21)."""
    if not field[0] & field[2] & field[4] & 1:
        return None
    return (field[0] >> 1 & 7) << 30 | field[1] << 22 | field[2] >> 1 << 15 | field[3] << 7 | field[4] >> 1
