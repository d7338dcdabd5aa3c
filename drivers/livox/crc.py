"""The two checksums of the protocol."""

from __future__ import annotations

import binascii
import zlib
from typing import TypeAlias

Buffer: TypeAlias = bytes | bytearray | memoryview


def crc16(data: Buffer) -> int:
    """CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF), over the first 18 bytes of a control frame."""
    return binascii.crc_hqx(data, 0xFFFF)


def crc32(data: Buffer) -> int:
    """CRC-32/ISO-HDLC, over the data of a control frame, and from the timestamp to the end of a data packet."""
    return zlib.crc32(data)
