"""MPEG transport stream as a HERO8 lays it out: H.264 on 0x1011, AAC on 0x1100, a private stream on 0x200."""

from __future__ import annotations

from drivers.gopro.tables import crc32_mpeg

PACKET = 188
PMT_PID, VIDEO_PID, AUDIO_PID, PRIVATE_PID = 0x0100, 0x1011, 0x1100, 0x0200
PTS_WRAP = 1 << 33
PCR_LEAD = 9_000
"""90 kHz ticks by which the stream's reference clock is behind the frames: 0.1 s."""
TABLES_EVERY = 10
"""Frames between two PAT and PMT, a third of a second."""
SILENCE = bytes.fromhex("211004608c1c")
"""One AAC-LC frame of stereo silence (1024 samples)."""


def adts(frame: bytes) -> bytes:
    """AAC-LC, 48 kHz, stereo, with its ADTS header (ISO/IEC 13818-7, 6.2)."""
    size = len(frame) + 7
    return bytes((0xFF, 0xF1, 0x4C, 0x80 | size >> 11, size >> 3 & 0xFF, (size & 7) << 5 | 0x1F, 0xFC)) + frame


class TransportMux:
    """Writes one program. All times are 90 kHz ticks; they wrap at 33 bits by themselves."""

    def __init__(self) -> None:
        self._counters: dict[int, int] = {}
        self._frames = 0

    def video(self, access_unit: bytes, pts: int) -> bytes:
        """Packets of one access unit, with the tables before it when they are due."""
        tables = self._tables() if self._frames % TABLES_EVERY == 0 else b""
        self._frames += 1
        pes = b"\x00\x00\x01\xe0\x00\x00\x84\x80\x05" + _timestamp(pts) + access_unit
        return tables + self._packets(VIDEO_PID, pes, pcr=(pts - PCR_LEAD) % PTS_WRAP)

    def audio(self, pts: int) -> bytes:
        """Packets of one frame of silence."""
        frame = adts(SILENCE)
        size = len(frame) + 8
        return self._packets(
            AUDIO_PID, b"\x00\x00\x01\xc0" + size.to_bytes(2, "big") + b"\x80\x80\x05" + _timestamp(pts) + frame
        )

    def private(self, payload: bytes) -> bytes:
        """Packets of the stream that nobody can read."""
        pes = b"\x00\x00\x01\xbd" + (len(payload) + 3).to_bytes(2, "big") + b"\x80\x00\x00" + payload
        return self._packets(PRIVATE_PID, pes)

    def _tables(self) -> bytes:
        pat = _section(0x00, 1, (1).to_bytes(2, "big") + (0xE000 | PMT_PID).to_bytes(2, "big"))
        streams = b"".join(
            bytes((kind,)) + (0xE000 | pid).to_bytes(2, "big") + b"\xf0\x00"
            for kind, pid in ((0x1B, VIDEO_PID), (0x0F, AUDIO_PID), (0x80, PRIVATE_PID))
        )
        pmt = _section(0x02, 1, (0xE000 | VIDEO_PID).to_bytes(2, "big") + b"\xf0\x00" + streams)
        return self._packets(0, b"\x00" + pat, table=True) + self._packets(PMT_PID, b"\x00" + pmt, table=True)

    def _packets(self, pid: int, data: bytes, pcr: int | None = None, table: bool = False) -> bytes:
        out = bytearray()
        at = 0
        while at < len(data):
            counter = self._counters.get(pid, 0)
            self._counters[pid] = counter + 1 & 0x0F
            clock = _clock(pcr) if pcr is not None and at == 0 else b""
            room = PACKET - 4 - (len(clock) + 1 if clock else 0)
            part = data[at : at + room]
            if table:
                body, control = part + b"\xff" * (room - len(part)), 1
            else:
                body, control = _adapted(clock, part)
            head = pid | (0x4000 if at == 0 else 0)
            out += bytes((0x47, head >> 8, head & 0xFF, control << 4 | counter)) + body
            at += len(part)
        return bytes(out)


def _adapted(fields: bytes, payload: bytes) -> tuple[bytes, int]:
    """Payload with an adaptation field that fills the packet, and the adaptation control."""
    spare = PACKET - 4 - len(payload)
    if spare == 0:
        return payload, 1
    if spare == 1:
        return b"\x00" + payload, 3
    fields = fields or b"\x00"
    return bytes((spare - 1,)) + fields + b"\xff" * (spare - 1 - len(fields)) + payload, 3


def _section(table: int, number: int, body: bytes) -> bytes:
    size = len(body) + 9
    head = bytes((table,)) + (0xB000 | size).to_bytes(2, "big") + number.to_bytes(2, "big") + b"\xc1\x00\x00"
    return head + body + crc32_mpeg(head + body).to_bytes(4, "big")


def _timestamp(pts: int) -> bytes:
    pts %= PTS_WRAP
    high, middle, low = pts >> 30, pts >> 15 & 0x7FFF, pts & 0x7FFF
    return bytes((0x21 | high << 1,)) + (middle << 1 | 1).to_bytes(2, "big") + (low << 1 | 1).to_bytes(2, "big")


def _clock(base: int) -> bytes:
    """Adaptation field with a PCR and nothing else (2.4.3.5)."""
    return b"\x10" + (base << 15 | 0x7E00).to_bytes(6, "big")
