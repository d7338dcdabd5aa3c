"""Point and IMU packets as a Mid-360 writes them."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from drivers.livox.packets import HEADER, POINT_INTERVAL, POINTS_PER_PACKET, RECORDS, DataType
from drivers.sim.sources import PointBlock

IMU_BYTES = 60
_IMU_HEAD = struct.Struct("<BHHHHBBB12x")
_IMU_BODY = struct.Struct("<Q6f")


def point_packets(
    block: PointBlock, data_type: int, stamps_ns: npt.NDArray[np.int64], first_count: int
) -> npt.NDArray[np.uint8]:
    """(n, packet bytes) packets of 96 points from a block of n * 96 slots. Their checksum is 0, as on hardware."""
    records = RECORDS[data_type]
    layout = np.dtype([("head", HEADER), ("points", records, (POINTS_PER_PACKET,))])
    packets = np.zeros(len(stamps_ns), layout)
    head = packets["head"]
    head["length"] = layout.itemsize
    head["time_interval"] = POINT_INTERVAL
    head["dot_num"] = POINTS_PER_PACKET
    head["udp_cnt"] = (first_count + np.arange(len(stamps_ns))) & 0xFFFF
    head["data_type"] = data_type
    head["timestamp"] = stamps_ns
    points = packets["points"]
    _write_positions(points, data_type, block.xyz_mm.reshape(len(stamps_ns), POINTS_PER_PACKET, 3))
    points["reflectivity"] = block.reflectivity.reshape(points.shape)
    points["tag"] = block.tag.reshape(points.shape)
    return packets.view(np.uint8).reshape(len(stamps_ns), layout.itemsize)


def _write_positions(points: npt.NDArray[Any], data_type: int, xyz_mm: npt.NDArray[np.int32]) -> None:
    if data_type == DataType.CARTESIAN_32:
        points["xyz"] = xyz_mm
    elif data_type == DataType.CARTESIAN_16:
        points["xyz"] = np.rint(xyz_mm / 10.0)
    else:
        x, y, z = np.moveaxis(xyz_mm.astype(np.float64), -1, 0)
        radius = np.sqrt(x * x + y * y + z * z)
        points["depth"] = np.rint(radius)
        points["theta"] = np.rint(np.rad2deg(np.arccos(z / np.maximum(radius, 1.0))) * 100.0)
        points["phi"] = np.rint(np.rad2deg(np.arctan2(y, x)) * 100.0) % 36000


def imu_packet(
    gyro_rad_s: tuple[float, float, float], accel_g: tuple[float, float, float], stamp_ns: int, count: int
) -> bytes:
    """One IMU packet, with a valid checksum as on hardware."""
    head = _IMU_HEAD.pack(0, IMU_BYTES, 0, 1, count & 0xFFFF, 0, DataType.IMU, 0)
    body = _IMU_BODY.pack(stamp_ns, *gyro_rad_s, *accel_g)
    return head + zlib.crc32(body).to_bytes(4, "little") + body
