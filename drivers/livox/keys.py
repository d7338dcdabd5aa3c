"""The parameters of a Mid-360 as one table, and one parser and encoder for all of them."""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, TypeAlias

from drivers.errors import ProtocolError

Value: TypeAlias = Any
"""int, str, tuple of numbers, Endpoint or Network, as the key's codec says."""


class Key(IntEnum):
    """Parameter keys of commands 0x0100, 0x0101 and 0x0102."""

    POINT_TYPE = 0x0000
    PATTERN = 0x0001
    NETWORK = 0x0004
    STATUS_HOST = 0x0005
    POINT_HOST = 0x0006
    IMU_HOST = 0x0007
    ATTITUDE = 0x0012
    FOV_0 = 0x0015
    FOV_1 = 0x0016
    FOV_ENABLE = 0x0017
    DETECT_MODE = 0x0018
    IO = 0x0019
    WORK_TARGET = 0x001A
    IMU_ENABLE = 0x001C
    SERIAL = 0x8000
    PRODUCT = 0x8001
    VERSION_APP = 0x8002
    VERSION_LOADER = 0x8003
    VERSION_HARDWARE = 0x8004
    MAC = 0x8005
    WORK_STATE = 0x8006
    CORE_TEMPERATURE = 0x8007
    POWER_UPS = 0x8008
    LOCAL_TIME = 0x8009
    LAST_SYNC = 0x800A
    TIME_OFFSET = 0x800B
    TIME_SYNC = 0x800C
    DIAGNOSIS = 0x800E
    FIRMWARE_TYPE = 0x8010
    HMS = 0x8011


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Where a stream goes: host address and port, and the port of the LiDAR it comes from."""

    address: str
    port: int
    source_port: int


@dataclass(frozen=True, slots=True)
class Network:
    """The LiDAR's own IPv4 settings."""

    address: str
    mask: str
    gateway: str


@dataclass(frozen=True, slots=True)
class Parameter:
    """One row of the table: name, length on the wire, codec."""

    name: str
    length: int
    decode: Callable[[bytes], Value]
    encode: Callable[[Value], bytes]


def _number(name: str, layout: str) -> Parameter:
    codec = struct.Struct("<" + layout)
    return Parameter(name, codec.size, lambda raw: codec.unpack(raw)[0], codec.pack)


def _numbers(name: str, layout: str) -> Parameter:
    codec = struct.Struct("<" + layout)
    return Parameter(name, codec.size, codec.unpack, lambda values: codec.pack(*values))


def _text(name: str, length: int) -> Parameter:
    return Parameter(name, length, text_of, lambda text: text.encode("latin-1")[:length].ljust(length, b"\0"))


def text_of(raw: bytes) -> str:
    """A NUL-padded string, which may also fill its field without a NUL."""
    return raw.split(b"\0", 1)[0].decode("latin-1")


def _endpoint(name: str) -> Parameter:
    def decode(raw: bytes) -> Endpoint:
        return Endpoint(socket.inet_ntoa(raw[:4]), *struct.unpack("<HH", raw[4:]))

    def encode(value: Endpoint) -> bytes:
        return socket.inet_aton(value.address) + struct.pack("<HH", value.port, value.source_port)

    return Parameter(name, 8, decode, encode)


def _network(name: str) -> Parameter:
    def decode(raw: bytes) -> Network:
        return Network(*(socket.inet_ntoa(raw[at : at + 4]) for at in (0, 4, 8)))

    def encode(value: Network) -> bytes:
        return b"".join(map(socket.inet_aton, (value.address, value.mask, value.gateway)))

    return Parameter(name, 12, decode, encode)


PARAMETERS: dict[int, Parameter] = {
    Key.POINT_TYPE: _number("point type", "B"),
    Key.PATTERN: _number("scan pattern", "B"),
    Key.NETWORK: _network("network settings"),
    Key.STATUS_HOST: _endpoint("status destination"),
    Key.POINT_HOST: _endpoint("point destination"),
    Key.IMU_HOST: _endpoint("IMU destination"),
    Key.ATTITUDE: _numbers("mounting attitude (deg, mm)", "fffiii"),
    Key.FOV_0: _numbers("field of view 0 (deg)", "iiiiI"),
    Key.FOV_1: _numbers("field of view 1 (deg)", "iiiiI"),
    Key.FOV_ENABLE: _number("fields of view in use", "B"),
    Key.DETECT_MODE: _number("detection mode", "B"),
    Key.IO: _numbers("pins", "BBBB"),
    Key.WORK_TARGET: _number("target state", "B"),
    Key.IMU_ENABLE: _number("IMU on", "B"),
    Key.SERIAL: _text("serial number", 16),
    Key.PRODUCT: _text("product", 64),
    Key.VERSION_APP: _numbers("firmware", "BBBB"),
    Key.VERSION_LOADER: _numbers("loader", "BBBB"),
    Key.VERSION_HARDWARE: _numbers("hardware", "BBBB"),
    Key.MAC: _numbers("MAC address", "BBBBBB"),
    Key.WORK_STATE: _number("state", "B"),
    Key.CORE_TEMPERATURE: _number("core temperature (0.01 degC)", "i"),
    Key.POWER_UPS: _number("power-ups", "I"),
    Key.LOCAL_TIME: _number("LiDAR time (ns)", "Q"),
    Key.LAST_SYNC: _number("last synchronisation (ns)", "Q"),
    Key.TIME_OFFSET: _number("time offset (ns)", "q"),
    Key.TIME_SYNC: _number("time synchronisation", "B"),
    Key.DIAGNOSIS: _number("diagnosis", "H"),
    Key.FIRMWARE_TYPE: _number("firmware type", "B"),
    Key.HMS: _numbers("health codes", "8I"),
}
"""Exactly the 30 keys a Mid-360 pushes, 401 bytes with their heads (reference sheet, section 6)."""


def writable(key: int) -> bool:
    """Whether a key is a setting. Keys from 0x8000 on are facts."""
    return key < 0x8000


def encode_value(key: int, value: Value) -> bytes:
    """The bytes of a parameter. ProtocolError for an unknown key or a value that does not fit."""
    parameter = PARAMETERS.get(key)
    if parameter is None:
        raise ProtocolError(f"parameter {key:#06x} is unknown to this program")
    try:
        return parameter.encode(value)
    except (struct.error, OSError, TypeError, AttributeError, UnicodeError) as error:
        raise ProtocolError(f"{parameter.name} ({key:#06x}) cannot be {value!r}: {error}") from error


def decode_value(key: int, raw: bytes) -> Value:
    """The value of a parameter; bytes as they are when the key is unknown. ProtocolError for a wrong length."""
    parameter = PARAMETERS.get(key)
    if parameter is None:
        return raw
    if len(raw) != parameter.length:
        raise ProtocolError(f"{parameter.name} ({key:#06x}) has {len(raw)} bytes, {parameter.length} expected")
    return parameter.decode(raw)
