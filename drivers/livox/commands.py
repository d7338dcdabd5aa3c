"""What the control frames carry: discovery, lists of parameters, return codes."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum

from drivers.errors import ProtocolError
from drivers.livox.keys import Value, decode_value, encode_value, text_of

MID360 = 9
DEVICE_NAMES = {9: "Mid-360", 10: "HAP (TX)", 15: "HAP (T1)", 16: "PA", 35: "Mid-360S", 40: "Avia2"}
_DISCOVERED = struct.Struct("<BB16s4sH")
_ITEM = struct.Struct("<HH")


class ReturnCode(IntEnum):
    """First byte of every ACK."""

    OK = 0x00
    FAILED = 0x01
    NOT_NOW = 0x02
    OUT_OF_RANGE = 0x03
    UNSUPPORTED = 0x20
    AFTER_REBOOT = 0x21
    READ_ONLY = 0x22
    BAD_LENGTH = 0x23
    BAD_COUNT = 0x24


RETURN_TEXTS: dict[int, str] = {
    ReturnCode.OK: "accepted",
    ReturnCode.FAILED: "failed",
    ReturnCode.NOT_NOW: "not permitted in the present state",
    ReturnCode.OUT_OF_RANGE: "value out of range",
    ReturnCode.UNSUPPORTED: "parameter not supported",
    ReturnCode.AFTER_REBOOT: "stored, holds after a reboot",
    ReturnCode.READ_ONLY: "parameter is read-only",
    ReturnCode.BAD_LENGTH: "wrong length",
    ReturnCode.BAD_COUNT: "number of parameters does not match the list",
}


@dataclass(frozen=True, slots=True)
class Discovered:
    """Answer to a discovery: who is there, and where it takes commands."""

    return_code: int
    device_type: int
    serial: str
    address: str
    command_port: int


@dataclass(frozen=True, slots=True)
class WriteReply:
    """Answer to a write: the code, and the key it is about (0 when none)."""

    return_code: int
    error_key: int


@dataclass(frozen=True, slots=True)
class ReadReply:
    """Answer to a read. The values count also when the code is UNSUPPORTED: they are those that are supported."""

    return_code: int
    values: dict[int, Value]


def encode_discovered(answer: Discovered) -> bytes:
    """Data of a discovery ACK."""
    serial = answer.serial.encode("latin-1")
    address = socket.inet_aton(answer.address)
    return _DISCOVERED.pack(answer.return_code, answer.device_type, serial, address, answer.command_port)


def decode_discovered(data: bytes) -> Discovered:
    """Discovery ACK from its data."""
    if len(data) != _DISCOVERED.size:
        raise ProtocolError(f"discovery answer of {len(data)} bytes, {_DISCOVERED.size} expected")
    code, kind, serial, address, port = _DISCOVERED.unpack(data)
    return Discovered(code, kind, text_of(serial), socket.inet_ntoa(address), port)


def encode_values(values: Mapping[int, Value]) -> bytes:
    """Data of a write request or a status push: count, two reserved bytes, the list."""
    return struct.pack("<HH", len(values), 0) + _encode_list(values)


def decode_raw_values(data: bytes) -> dict[int, bytes]:
    """List of a write request or a push, values as bytes. ProtocolError when count and list disagree."""
    return _decode_list(data, _count(data, 0, 4), 4)


def decode_values(data: bytes) -> dict[int, Value]:
    """List of a write request or a status push."""
    return {key: decode_value(key, raw) for key, raw in decode_raw_values(data).items()}


def encode_keys(keys: Iterable[int]) -> bytes:
    """Data of a read request."""
    keys = tuple(keys)
    return struct.pack(f"<HH{len(keys)}H", len(keys), 0, *keys)


def decode_keys(data: bytes) -> tuple[int, ...]:
    """Keys of a read request. ProtocolError when count and list disagree."""
    count = _count(data, 0, 4)
    if len(data) != 4 + 2 * count:
        raise ProtocolError(f"read request of {len(data)} bytes for {count} keys")
    return struct.unpack_from(f"<{count}H", data, 4)


def encode_write_reply(reply: WriteReply) -> bytes:
    """Data of a write ACK."""
    return struct.pack("<BH", reply.return_code, reply.error_key)


def decode_write_reply(data: bytes) -> WriteReply:
    """Write ACK from its data."""
    if len(data) < 3:
        raise ProtocolError(f"write answer of {len(data)} bytes, 3 expected")
    return WriteReply(*struct.unpack_from("<BH", data))


def encode_read_reply(reply: ReadReply) -> bytes:
    """Data of a read ACK: the list starts at offset 3, not 4 as in a push."""
    return struct.pack("<BH", reply.return_code, len(reply.values)) + _encode_list(reply.values)


def decode_read_reply(data: bytes) -> ReadReply:
    """Read ACK from its data."""
    raw = _decode_list(data, _count(data, 1, 3), 3)
    return ReadReply(data[0], {key: decode_value(key, value) for key, value in raw.items()})


def _count(data: bytes, offset: int, head: int) -> int:
    if len(data) < head:
        raise ProtocolError(f"parameter list of {len(data)} bytes, at least {head} expected")
    return int(struct.unpack_from("<H", data, offset)[0])


def _encode_list(values: Mapping[int, Value]) -> bytes:
    items = ((key, encode_value(key, value)) for key, value in values.items())
    return b"".join(_ITEM.pack(key, len(raw)) + raw for key, raw in items)


def _decode_list(data: bytes, count: int, at: int) -> dict[int, bytes]:
    values: dict[int, bytes] = {}
    for _ in range(count):
        if at + _ITEM.size > len(data):
            raise ProtocolError(f"parameter list ends after {len(values)} of {count} parameters")
        key, length = _ITEM.unpack_from(data, at)
        at += _ITEM.size + length
        if at > len(data):
            raise ProtocolError(f"parameter {key:#06x} claims {length} bytes, more than the frame holds")
        values[key] = data[at - length : at]
    if at != len(data):
        raise ProtocolError(f"{len(data) - at} bytes follow the {count} parameters of a list")
    return values
