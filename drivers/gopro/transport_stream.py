"""MPEG transport stream (ISO/IEC 13818-1) to H.264 access units, for the one video stream a camera sends.

Bytes come in any chunks; what comes out does not depend on how they were cut. Nothing raises: what is not a
transport stream is skipped and counted. An access unit with a hole in it is dropped and counted, never emitted.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.gopro.packetized import PesAssembler
from drivers.gopro.tables import SectionAssembler, read_pat, read_pmt

PACKET = 188
SYNC = 0x47
PAT_PID = 0x0000
H264 = 0x1B


@dataclass(frozen=True, slots=True)
class AccessUnit:
    """One PES packet's payload. pts: 33 bits of 90 kHz. receive_ns: host time of its first byte."""

    data: bytes
    pts: int
    receive_ns: int


@dataclass(slots=True)
class StreamLosses:
    """What was lost or skipped since the start."""

    packets: int = 0
    """TS packets of the video missing by their continuity counter (modulo 16: a lower bound)."""
    units: int = 0
    """Access units dropped because a part was missing or unreadable."""
    skipped_bytes: int = 0
    """Bytes that were no transport stream."""


class Demuxer:
    """Incremental demuxer of the first H.264 stream of the first program."""

    def __init__(self) -> None:
        self.losses = StreamLosses()
        self.video_pid: int | None = None
        self._pmt_pid: int | None = None
        self._pat = SectionAssembler()
        self._pmt = SectionAssembler()
        self._pes = PesAssembler()
        self._counter: int | None = None
        self._last = b""
        self._rest = b""
        self._rest_ns = 0
        self._synced = False

    def feed(self, chunk: bytes, receive_ns: int) -> list[AccessUnit]:
        """Take bytes in, give the access units that are complete now."""
        units: list[AccessUnit] = []
        carried = len(self._rest)
        data = self._rest + chunk if carried else chunk
        position, end = 0, len(data)
        while True:
            if not self._synced and (position := self._resync(data, position)) < 0:
                position = -position - 1
                break
            if end - position < PACKET:
                break
            if data[position] != SYNC:
                self._synced = False
                continue
            packet = data[position : position + PACKET]
            self._packet(packet, self._rest_ns if position < carried else receive_ns, units)
            position += PACKET
        if position >= carried:
            self._rest_ns = receive_ns
        self._rest = data[position:]
        return units

    def flush(self) -> list[AccessUnit]:
        """Give what is there when nothing more comes: the last access unit has no successor to end it.

        If the end of that one was lost, nothing in the stream says so.
        """
        units: list[AccessUnit] = []
        if len(self._rest) == PACKET and self._rest[0] == SYNC:
            self._packet(self._rest, self._rest_ns, units)
            self._rest = b""
        self._finish(units)
        return units

    def restart(self) -> None:
        """A new stream begins: what the old one left unfinished goes, uncounted."""
        self._pes.finish()
        self._counter, self._last = None, b""

    def _resync(self, data: bytes, position: int) -> int:
        """Offset of the next sync byte that has another one a packet later, or -(offset to keep) - 1."""
        start = position
        while True:
            found = data.find(SYNC, position)
            if found < 0:
                found = len(data)
            if found + PACKET >= len(data):
                self.losses.skipped_bytes += found - start
                return -found - 1
            if data[found + PACKET] == SYNC:
                self.losses.skipped_bytes += found - start
                self._synced = True
                return found
            position = found + 1

    def _packet(self, packet: bytes, receive_ns: int, units: list[AccessUnit]) -> None:
        pid = (packet[1] & 0x1F) << 8 | packet[2]
        if pid == self.video_pid:
            self._video(packet, receive_ns, units)
        elif pid in (PAT_PID, self._pmt_pid):
            self._table(pid, packet, units)

    def _table(self, pid: int, packet: bytes, units: list[AccessUnit]) -> None:
        payload = _payload(packet)
        if payload is None or packet[1] & 0x80:
            return
        assembler = self._pat if pid == PAT_PID else self._pmt
        for section in assembler.add(payload, start=bool(packet[1] & 0x40)):
            if pid == PAT_PID:
                found = read_pat(section)
                self._pmt_pid = self._pmt_pid if found is None else found
            elif (video := read_pmt(section, H264)) is not None and video != self.video_pid:
                self._finish(units)
                self.video_pid, self._counter, self._last = video, None, b""

    def _video(self, packet: bytes, receive_ns: int, units: list[AccessUnit]) -> None:
        payload = _payload(packet)
        if packet[1] & 0x80 or payload is None:  # transport_error_indicator: the packet counts as missing
            return
        if not payload and not packet[3] & 0x10:
            return
        if not self._continues(packet):
            return
        if packet[1] & 0x40:
            self._finish(units)
            self._pes.start(payload, receive_ns)
        else:
            self._pes.append(payload)
        if self._pes.complete:
            self._finish(units)

    def _continues(self, packet: bytes) -> bool:
        """Follow the continuity counter; False for a packet sent twice (2.4.3.3)."""
        counter = packet[3] & 0x0F
        expected = counter if self._counter is None else (self._counter + 1) & 0x0F
        if counter != expected and not _discontinuity(packet):
            if packet == self._last:
                return False
            self.losses.packets += (counter - expected) & 0x0F
            self._pes.break_off()
        self._counter, self._last = counter, packet
        return True

    def _finish(self, units: list[AccessUnit]) -> None:
        pes = self._pes.finish()
        if pes is None:
            return
        if pes.data and pes.pts is not None:
            units.append(AccessUnit(pes.data, pes.pts, pes.receive_ns))
        else:
            self.losses.units += 1


def _payload(packet: bytes) -> bytes | None:
    """Payload after the adaptation field; None when the header contradicts itself."""
    control = packet[3] >> 4 & 3
    if control == 1:
        return packet[4:]
    if control == 0:
        return None
    start = 5 + packet[4]
    if control == 2:
        return b""
    return packet[start:] if start <= PACKET else None


def _discontinuity(packet: bytes) -> bool:
    return bool(packet[3] & 0x20 and packet[4] and packet[5] & 0x80)
