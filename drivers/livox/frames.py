"""The envelope of every control frame: 24 bytes of header, two checksums, data.

Layout: sof u8, version u8, length u16, sequence u32, command u16, kind u8, sender u8, 6 reserved, crc16, crc32, data.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

from drivers.errors import ProtocolError
from drivers.livox.crc import Buffer, crc16, crc32

SOF = 0xAA
HEADER_BYTES = 24
LONGEST_BYTES = 1400
_HEAD = struct.Struct("<BBHIHBB6x")
_CHECKS = struct.Struct("<HI")


class Command(IntEnum):
    """What a frame is about."""

    DISCOVER = 0x0000
    WRITE = 0x0100
    READ = 0x0101
    PUSH = 0x0102
    REBOOT = 0x0200
    FACTORY_RESET = 0x0201
    GPS_TIME = 0x0202


class Kind(IntEnum):
    """Question or answer."""

    REQUEST = 0
    ACK = 1


class Sender(IntEnum):
    """Whose frame it is."""

    HOST = 0
    LIDAR = 1


@dataclass(frozen=True, slots=True)
class Frame:
    """One control frame. `command` is an int because devices may use commands this program does not know."""

    command: int
    sequence: int
    kind: Kind
    sender: Sender
    data: bytes = b""


def encode(frame: Frame) -> bytes:
    """The bytes of a frame. ProtocolError when the data do not fit into one."""
    length = HEADER_BYTES + len(frame.data)
    if length > LONGEST_BYTES:
        raise ProtocolError(f"a control frame holds at most {LONGEST_BYTES} bytes, this one would need {length}")
    head = _HEAD.pack(SOF, 0, length, frame.sequence & 0xFFFFFFFF, frame.command, frame.kind, frame.sender)
    return head + _CHECKS.pack(crc16(head), crc32(frame.data) if frame.data else 0) + frame.data


def decode(datagram: Buffer) -> Frame:
    """The frame in a datagram. ProtocolError says what is wrong with it."""
    if len(datagram) < HEADER_BYTES:
        raise ProtocolError(f"control frame of {len(datagram)} bytes, at least {HEADER_BYTES} expected")
    sof, version, length, sequence, command, kind, sender = _HEAD.unpack_from(datagram)
    if sof != SOF or version != 0:
        raise ProtocolError(f"control frame starts with {sof:#04x} version {version}, expected {SOF:#04x} version 0")
    if not HEADER_BYTES <= length <= min(len(datagram), LONGEST_BYTES):
        raise ProtocolError(f"control frame claims {length} bytes in a datagram of {len(datagram)}")
    head_check, data_check = _CHECKS.unpack_from(datagram, _HEAD.size)
    data = bytes(datagram[HEADER_BYTES:length])
    if head_check != crc16(datagram[: _HEAD.size]):
        raise ProtocolError("control frame with a wrong header checksum")
    if data_check != (crc32(data) if data else 0):
        raise ProtocolError("control frame with a wrong data checksum")
    if kind not in (0, 1) or sender not in (0, 1):
        raise ProtocolError(f"control frame of kind {kind} from sender {sender}, expected 0 or 1")
    return Frame(command, sequence, Kind(kind), Sender(sender), data)
