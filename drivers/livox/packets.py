"""Point and IMU packets: a 36-byte header and packed records, read as numpy arrays without copying."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from drivers.errors import ProtocolError
from drivers.livox.crc import Buffer, crc32

STANDARD_GRAVITY = 9.80665
"""m/s^2 in the g the accelerometer reports."""
POINTS_PER_PACKET = 96
PACKET_NS = 480_000
"""Time between two point packets: 96 points of 5 us."""
POINT_INTERVAL = 4750
"""time_interval of every point packet: 475.0 us from its first point to its last, in 0.1 us."""
INTERVAL_UNIT_NS = 100
LATEST_NS = 1 << 62
"""Times are signed 64-bit from here on; this is the year 2116."""
CRC_OFFSET = 24
CRC_START = 28
"""The checksum covers timestamp and data."""


class DataType(IntEnum):
    """What the records of a packet are."""

    IMU = 0
    CARTESIAN_32 = 1
    CARTESIAN_16 = 2
    SPHERICAL = 3


HEADER = np.dtype(
    [
        ("version", "u1"),
        ("length", "<u2"),
        ("time_interval", "<u2"),
        ("dot_num", "<u2"),
        ("udp_cnt", "<u2"),
        ("frame_cnt", "u1"),
        ("data_type", "u1"),
        ("time_type", "u1"),
        ("reserved", "V12"),
        ("crc32", "<u4"),
        ("timestamp", "<u8"),
    ]
)
RECORDS: dict[int, np.dtype[np.void]] = {
    DataType.IMU: np.dtype([("gyro", "<f4", (3,)), ("accel", "<f4", (3,))]),
    DataType.CARTESIAN_32: np.dtype([("xyz", "<i4", (3,)), ("reflectivity", "u1"), ("tag", "u1")]),
    DataType.CARTESIAN_16: np.dtype([("xyz", "<i2", (3,)), ("reflectivity", "u1"), ("tag", "u1")]),
    DataType.SPHERICAL: np.dtype(
        [("depth", "<u4"), ("theta", "<u2"), ("phi", "<u2"), ("reflectivity", "u1"), ("tag", "u1")]
    ),
}
_RECORD_BYTES = np.zeros(256, np.int64)
for _kind, _dtype in RECORDS.items():
    _RECORD_BYTES[_kind] = _dtype.itemsize


@dataclass(frozen=True, slots=True)
class Packet:
    """One data packet, decoded."""

    data_type: DataType
    time_type: int
    udp_cnt: int
    timestamp_ns: int
    time_interval: int
    records: npt.NDArray[Any]


def headers(slots: npt.NDArray[np.uint8]) -> npt.NDArray[Any]:
    """View of the headers of datagrams that lie one a row in `slots`, (n, slot bytes), slot bytes >= 36."""
    return np.ndarray((len(slots),), HEADER, slots.data, strides=(slots.strides[0],))


def records(slots: npt.NDArray[np.uint8], rows: npt.NDArray[np.intp], data_type: int, count: int) -> npt.NDArray[Any]:
    """Copy (len(rows), count) of the records of datagrams of one type and count that lie one a row in `slots`."""
    dtype = RECORDS[data_type]
    end = HEADER.itemsize + count * dtype.itemsize
    return slots[:, HEADER.itemsize : end].take(rows, axis=0).view(dtype)


def well_formed(head: npt.NDArray[Any], lengths: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Which datagrams are packets by their headers; `lengths` are those of the datagrams. Checksums not included."""
    size = _RECORD_BYTES[head["data_type"]]
    expected = HEADER.itemsize + size * head["dot_num"]
    known = (size > 0) & (head["dot_num"] > 0) & (head["version"] == 0) & (head["timestamp"] < LATEST_NS)
    return np.asarray(known & (head["length"] == lengths) & (expected == lengths))


def checksum_holds(slot: Buffer, length: int, expected: int) -> bool:
    """Real point packets carry 0, which means not computed; IMU packets carry a valid checksum."""
    return expected == 0 or crc32(memoryview(slot)[CRC_START:length]) == expected


def decode(datagram: Buffer) -> Packet:
    """One packet. ProtocolError when it is none."""
    slots = np.frombuffer(datagram, np.uint8).reshape(1, -1)
    if slots.size < HEADER.itemsize:
        raise ProtocolError(f"data packet of {slots.size} bytes, at least {HEADER.itemsize} expected")
    head = headers(slots)
    if not well_formed(head, np.array([slots.size]))[0]:
        raise ProtocolError(f"no data packet: version, type, count and length do not fit {slots.size} bytes")
    first = head[0]
    if not checksum_holds(datagram, slots.size, int(first["crc32"])):
        raise ProtocolError("data packet with a wrong checksum")
    return Packet(
        DataType(int(first["data_type"])),
        int(first["time_type"]),
        int(first["udp_cnt"]),
        int(first["timestamp"]),
        int(first["time_interval"]),
        records(slots, np.zeros(1, np.intp), int(first["data_type"]), int(first["dot_num"]))[0],
    )


def xyz_m(points: npt.NDArray[Any], data_type: int) -> npt.NDArray[np.float32]:
    """(n, 3) metres from records of a point type. int32 mm over 1000 is the nearest float32."""
    if data_type == DataType.SPHERICAL:
        radius = points["depth"] * 1e-3
        theta, phi = np.deg2rad(points["theta"] * 0.01), np.deg2rad(points["phi"] * 0.01)
        ring = radius * np.sin(theta)
        return np.stack((ring * np.cos(phi), ring * np.sin(phi), radius * np.cos(theta)), axis=-1).astype(np.float32)
    unit = np.float32(1000.0 if data_type == DataType.CARTESIAN_32 else 100.0)
    return points["xyz"].astype(np.float32) / unit


def returned(points: npt.NDArray[Any], data_type: int) -> npt.NDArray[np.bool_]:
    """Which records are returns; the others keep their place so that the index gives the time."""
    if data_type == DataType.SPHERICAL:
        return np.asarray(points["depth"] != 0)
    xyz = points["xyz"]
    return np.asarray((xyz[..., 0] | xyz[..., 1] | xyz[..., 2]) != 0)
