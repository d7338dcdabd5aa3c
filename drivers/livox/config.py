"""Settings of the Mid-360 driver. Every default is the standard of the device."""

from __future__ import annotations

from typing import Literal

import msgspec


class Config(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Addresses are IPv4. The LiDAR's ports are fixed by its firmware; they are settings for the sake of emulators."""

    address: str = ""
    """The LiDAR. Empty: the first Mid-360 that answers a discovery or is heard pushing its status."""
    serial_number: str = ""
    """Take no other LiDAR than this. Empty: any."""
    host_address: str = ""
    """This host on the LiDAR's network. Empty: found by the route to the LiDAR."""
    discovery_address: str = "255.255.255.255"
    """Where discovery is broadcast to; 127.255.255.255 for an emulator on loopback."""

    point_type: Literal["cartesian_32", "cartesian_16", "spherical"] = "cartesian_32"
    stop_state: Literal["idle", "ready", "sampling"] = "idle"
    """What the LiDAR is left doing: idle (laser off), ready (spinning, restarts at once), sampling."""

    discovery_port: int = 56000
    command_port: int = 56100
    status_source_port: int = 56200
    point_source_port: int = 56300
    imu_source_port: int = 56400
    host_discovery_port: int = 0
    """0: any free port."""
    host_command_port: int = 56101
    host_status_port: int = 56201
    host_point_port: int = 56301
    host_imu_port: int = 56401

    receive_buffer_bytes: int = 8 << 20
    """Asked of the kernel for the point socket; it grants at most net.core.rmem_max."""
    latency_ms: float = 0.0
    """Constant part of the transport delay, from the last point of a packet to its arrival, when it is known."""
    reply_timeout_s: float = 1.0
    attempts: int = 3
    retry_s: float = 1.0
    """Pause before looking for the LiDAR again."""
    silence_s: float = 2.5
    """Without data for this long the LiDAR is looked after."""
    start_timeout_s: float = 30.0
    """IDLE to SAMPLING takes 6 to 10 s; without points for this long after that the LiDAR is configured anew."""
