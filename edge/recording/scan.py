"""The records of an MCAP file by offset, without reading what is in them, and the way back after damage.

Every record is one byte of opcode, eight bytes of length, content. Most kinds hold a second length that must agree
with the first; that is what tells a record from noise. Sections in comments are those of the MCAP specification.
"""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from types import TracebackType

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Header, McapRecord, Metadata, Schema
from mcap.writer import MCAP0_MAGIC as MAGIC

from edge.errors import FormatError, RecordingError

HEADER_SIZE = 9
FOOTER_SIZE = HEADER_SIZE + 20
PRIVATE = 0x80
"""Opcodes from here on belong to applications; every reader skips those it does not know."""
_SEARCH_BLOCK = 4 << 20
_SMALL_RECORD_LIMIT = 64 << 20
_CANDIDATE = re.compile(rb"(?=[\x06\x07\x09\x0c].{5}\x00\x00\x00)", re.DOTALL)
"""Records that can be told from noise, with a length below 2^40."""
_CODECS = {b"", b"lz4", b"zstd"}
_UNREADABLE = (struct.error, EndOfFile, UnicodeDecodeError)


@dataclass(frozen=True, slots=True)
class Record:
    """Where a record lies. `offset` is that of its opcode, `length` that of its content, in bytes."""

    opcode: int
    offset: int
    length: int

    @property
    def content(self) -> int:
        return self.offset + HEADER_SIZE

    @property
    def end(self) -> int:
        return self.content + self.length


class RecordFile:
    """An MCAP file read by offset. FormatError when there is nothing of a recording in it."""

    def __init__(self, path: Path, *, writable: bool = False) -> None:
        self.path = path
        self.fd = _open(path, os.O_RDWR if writable else os.O_RDONLY)
        self.size = os.fstat(self.fd).st_size
        if self.size == 0:
            self.close()
            raise FormatError(f"{path}: the file is empty (0 bytes), there is nothing in it to read")

    def __enter__(self) -> RecordFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        os.close(self.fd)

    def read(self, offset: int, length: int) -> bytes:
        """Bytes at `offset`; fewer at the end of the file, whatever a damaged length asks for."""
        try:
            return os.pread(self.fd, min(length, self.size - offset), offset) if offset < self.size else b""
        except OSError as error:
            raise RecordingError(
                f"{self.path}: cannot read at byte {offset}: {error.strerror}; copy the card before doing more with it"
            ) from error

    def expect(self, spans: Iterable[tuple[int, int]]) -> None:
        """Ask the disk for (offset, length) parts that will be read soon, all at once: an hour cold in 1.2 s, not 4."""
        for offset, length in spans:
            if offset < self.size:
                os.posix_fadvise(self.fd, offset, min(length, self.size - offset), os.POSIX_FADV_WILLNEED)

    def read_scattered(self) -> None:
        """Say that small parts far from each other will be read: reading ahead would read the whole file."""
        os.posix_fadvise(self.fd, 0, 0, os.POSIX_FADV_RANDOM)

    def record_at(self, offset: int) -> Record | None:
        """The record that starts here, or None where none fits into the file."""
        head = self.read(offset, HEADER_SIZE)
        if len(head) < HEADER_SIZE:
            return None
        record = Record(head[0], offset, int.from_bytes(head[1:], "little"))
        return record if record.opcode and record.end <= self.size else None

    def content(self, record: Record) -> bytes:
        return self.read(record.content, record.length)

    def raw(self, record: Record) -> bytes:
        return self.read(record.offset, record.length + HEADER_SIZE)

    def header(self) -> Record | None:
        """The Header record, None where the beginning of the file is damaged."""
        first = self.record_at(len(MAGIC))
        if first is None or first.opcode != Opcode.HEADER or self.read(0, len(MAGIC)) != MAGIC:
            return None
        return first if parse(self, first, Header) else None

    def footer(self) -> Footer | None:
        """The Footer, None unless the file was finished and its summary is whole."""
        start = self.size - len(MAGIC) - FOOTER_SIZE
        if start < len(MAGIC) or self.read(self.size - len(MAGIC), len(MAGIC)) != MAGIC:
            return None
        record = self.record_at(start)
        if record is None or record.opcode != Opcode.FOOTER or record.length != FOOTER_SIZE - HEADER_SIZE:
            return None
        footer: Footer = Footer.read(ReadDataStream(BytesIO(self.content(record))))
        return footer if self._summary_is_whole(footer, start) else None

    def _summary_is_whole(self, footer: Footer, end: int) -> bool:
        if footer.summary_start > end:
            return False
        if footer.summary_crc == 0:
            return True
        start = footer.summary_start or end
        # "Footer": the CRC covers the summary and the footer up to the CRC itself.
        return zlib.crc32(self.read(start, end + HEADER_SIZE + 16 - start)) == footer.summary_crc

    def summary(self) -> Iterator[Record]:
        """The records of the summary section; nothing where there is none."""
        footer = self.footer()
        offset = footer.summary_start if footer else 0
        while offset:
            record = self.record_at(offset)
            if record is None or record.opcode == Opcode.FOOTER:
                return
            yield record
            offset = record.end


def _open(path: Path, flags: int) -> int:
    try:
        if path.is_dir():
            raise FormatError(f"{path} is a folder; name a recording in it (*.mcap)")
        return os.open(path, flags | os.O_CLOEXEC)
    except FileNotFoundError as error:
        raise FormatError(f"{path}: there is no such file") from error
    except PermissionError as error:
        raise FormatError(f"{path}: not allowed to open it; check its owner and mode, or use sudo") from error
    except OSError as error:
        raise FormatError(f"{path}: cannot be opened: {error.strerror}") from error


def packed(record: McapRecord) -> bytes:
    """The record as it stands in a file."""
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


def parse(file: RecordFile, record: Record, kind: type[McapRecord]) -> McapRecord | None:
    """The record as a `kind` of `mcap.records`, None where it is not one to the last byte."""
    if record.length > _SMALL_RECORD_LIMIT:
        return None
    raw = file.raw(record)
    try:
        parsed: McapRecord = kind.read(ReadDataStream(BytesIO(raw[HEADER_SIZE:])))  # type: ignore[attr-defined]
        return parsed if packed(parsed) == raw else None
    except _UNREADABLE:
        return None


def plausible(file: RecordFile, record: Record) -> bool:
    """Whether the inner lengths of a record of the data section agree with its outer one."""
    if record.opcode >= PRIVATE:
        # A chunk whose opcode lost its top bit reads as a private record.
        return not _chunk_fits(file, record)
    check = _CHECKS.get(record.opcode)
    return check is not None and check(file, record)


def _index_fits(file: RecordFile, record: Record) -> bool:
    head = file.read(record.content, 6)
    array = int.from_bytes(head[2:], "little")
    return len(head) == 6 and record.length == 6 + array and array % 16 == 0


def _chunk_fits(file: RecordFile, record: Record) -> bool:
    head = file.read(record.content, 44)
    if len(head) < 40 or record.length < 40:
        return False
    name_length = int.from_bytes(head[28:32], "little")
    if name_length > 4 or head[32 : 32 + name_length] not in _CODECS:
        return False
    size = file.read(record.content + 32 + name_length, 8)
    return record.length == 40 + name_length + int.from_bytes(size, "little")


def _attachment_fits(file: RecordFile, record: Record) -> bool:
    offset = record.content + 16
    for width in (4, 4, 8):  # name, media type, data
        size = int.from_bytes(file.read(offset, width), "little")
        offset += width + size
        if offset + 4 > record.end:
            return False
    if offset + 4 != record.end:
        return False
    expected = int.from_bytes(file.read(offset, 4), "little")
    return expected in {0, crc_of(file, record.content, offset)}


def crc_of(file: RecordFile, start: int, end: int) -> int:
    """CRC-32 of a part of the file, read in blocks."""
    crc = 0
    for offset in range(start, end, _SEARCH_BLOCK):
        crc = zlib.crc32(file.read(offset, min(_SEARCH_BLOCK, end - offset)), crc)
    return crc


_CHECKS: dict[int, Callable[[RecordFile, Record], bool]] = {
    Opcode.SCHEMA: lambda file, record: parse(file, record, Schema) is not None,
    Opcode.CHANNEL: lambda file, record: parse(file, record, Channel) is not None,
    Opcode.MESSAGE: lambda _, record: record.length >= 22,
    Opcode.CHUNK: _chunk_fits,
    Opcode.MESSAGE_INDEX: _index_fits,
    Opcode.ATTACHMENT: _attachment_fits,
    Opcode.METADATA: lambda file, record: parse(file, record, Metadata) is not None,
    Opcode.DATA_END: lambda _, record: record.length == 4,
}


def resync(file: RecordFile, offset: int) -> Record | None:
    """The first record at or after `offset` that is surely one: a chunk, an index, metadata or an attachment."""
    while offset < file.size:
        block = file.read(offset, _SEARCH_BLOCK + HEADER_SIZE - 1)
        for match in _CANDIDATE.finditer(block):
            record = file.record_at(offset + match.start())
            if record and record.length > 6 and plausible(file, record):
                return record
        offset += _SEARCH_BLOCK
    return None
