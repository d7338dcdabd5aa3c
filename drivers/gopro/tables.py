"""Program tables of a transport stream: sections, PAT and PMT (ISO/IEC 13818-1, 2.4.4)."""

from __future__ import annotations

PAT_TABLE = 0x00
PMT_TABLE = 0x02


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        value = byte << 24
        for _ in range(8):
            value = (value << 1) ^ (0x04C11DB7 if value & 0x80000000 else 0)
        table.append(value & 0xFFFFFFFF)
    return tuple(table)


_CRC = _crc_table()


def crc32_mpeg(data: bytes) -> int:
    """CRC-32/MPEG-2: not reflected, start value all ones. Zero over a section with its own CRC."""
    value = 0xFFFFFFFF
    for byte in data:
        value = (value << 8 & 0xFFFFFFFF) ^ _CRC[value >> 24 ^ byte]
    return value


class SectionAssembler:
    """Sections out of the payloads of one PID."""

    def __init__(self) -> None:
        self._buffer: bytes | None = None

    def add(self, payload: bytes, start: bool) -> list[bytes]:
        """Sections that are complete with this payload and whose CRC is right."""
        if start:
            if not payload:
                return []
            pointer = 1 + payload[0]
            sections = self._take(payload[1:pointer])
            self._buffer = payload[pointer:]
            return sections + self._take(b"")
        return self._take(payload)

    def _take(self, payload: bytes) -> list[bytes]:
        sections: list[bytes] = []
        if self._buffer is None:
            return sections
        self._buffer += payload
        while len(self._buffer) >= 3 and self._buffer[0] != 0xFF:  # 0xFF: stuffing up to the packet's end
            size = 3 + ((self._buffer[1] & 0x0F) << 8 | self._buffer[2])
            if len(self._buffer) < size:
                return sections
            section, self._buffer = self._buffer[:size], self._buffer[size:]
            if crc32_mpeg(section) == 0:
                sections.append(section)
        if self._buffer[:1] == b"\xff":
            self._buffer = None
        return sections


def read_pat(section: bytes) -> int | None:
    """PID of the first program's PMT."""
    if not _current(section, PAT_TABLE):
        return None
    for at in range(8, len(section) - 7, 4):
        if int.from_bytes(section[at : at + 2], "big"):
            return int.from_bytes(section[at + 2 : at + 4], "big") & 0x1FFF
    return None


def read_pmt(section: bytes, stream_type: int) -> int | None:
    """PID of the first elementary stream of a type."""
    if not _current(section, PMT_TABLE) or len(section) < 16:
        return None
    at = 12 + (int.from_bytes(section[10:12], "big") & 0x0FFF)
    while at + 5 <= len(section) - 4:
        if section[at] == stream_type:
            return int.from_bytes(section[at + 1 : at + 3], "big") & 0x1FFF
        at += 5 + (int.from_bytes(section[at + 3 : at + 5], "big") & 0x0FFF)
    return None


def _current(section: bytes, table: int) -> bool:
    """A section of this table that applies now, not only later."""
    return len(section) >= 12 and section[0] == table and bool(section[5] & 1)
