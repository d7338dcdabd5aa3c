"""The LiDAR's own word on itself: states, identity, and the status push."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from drivers.livox.keys import Endpoint, Key, Value


class WorkState(IntEnum):
    """States of the device. Only SAMPLING, IDLE and READY can be asked for."""

    SAMPLING = 1
    IDLE = 2
    SLEEP = 3
    ERROR = 4
    SELFCHECK = 5
    MOTOR_STARTUP = 6
    MOTOR_STOP = 7
    UPGRADE = 8
    READY = 9


TIME_SOURCES = {0: "", 1: "PTP", 2: "GPS"}
LOADER = 0
"""Firmware type of a device stuck in its loader."""


@dataclass(frozen=True, slots=True)
class Identity:
    """Who the LiDAR is."""

    serial: str
    product: str
    firmware: str
    mac: str
    in_loader: bool


@dataclass(frozen=True, slots=True)
class Status:
    """What a status push says. None where the push did not hold the key."""

    work_state: int | None
    temperature_c: float | None
    power_ups: int | None
    time_source: str
    last_sync_ns: int | None
    time_offset_ns: int | None
    diagnosis: int
    hms: tuple[int, ...]
    point_host: Endpoint | None
    imu_host: Endpoint | None
    serial: str


def read_status(values: Mapping[int, Value]) -> Status:
    """Status from the parameters of a push or of a read."""
    centidegrees = values.get(Key.CORE_TEMPERATURE)
    return Status(
        work_state=values.get(Key.WORK_STATE),
        temperature_c=None if centidegrees is None else centidegrees / 100.0,
        power_ups=values.get(Key.POWER_UPS),
        time_source=TIME_SOURCES.get(values.get(Key.TIME_SYNC, 0), "unknown"),
        last_sync_ns=values.get(Key.LAST_SYNC),
        time_offset_ns=values.get(Key.TIME_OFFSET),
        diagnosis=values.get(Key.DIAGNOSIS, 0),
        hms=tuple(code for code in values.get(Key.HMS, ()) if code),
        point_host=values.get(Key.POINT_HOST),
        imu_host=values.get(Key.IMU_HOST),
        serial=values.get(Key.SERIAL, ""),
    )


def read_identity(values: Mapping[int, Value]) -> Identity:
    """Identity from the parameters of a read."""
    return Identity(
        serial=values.get(Key.SERIAL, ""),
        product=values.get(Key.PRODUCT, ""),
        firmware=firmware_text(values.get(Key.VERSION_APP, (0, 0, 0, 0))),
        mac=":".join(f"{byte:02x}" for byte in values.get(Key.MAC, ())),
        in_loader=values.get(Key.FIRMWARE_TYPE, 1) == LOADER,
    )


def firmware_text(version: tuple[int, int, int, int]) -> str:
    """Display form of the four version bytes: (13, 18, 2, 44) is 13.18.0244."""
    return f"{version[0]}.{version[1]}.{version[2] * 100 + version[3]:04d}"


def state_text(state: int | None) -> str:
    """Name of a work state, lower case."""
    if state is None:
        return "unknown"
    return WorkState(state).name.lower().replace("_", " ") if state in set(WorkState) else f"state {state}"
