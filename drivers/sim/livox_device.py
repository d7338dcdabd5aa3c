"""The emulated Mid-360 without its sockets: parameters, states, and its answers to commands, oddities included."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass

from drivers.errors import ProtocolError
from drivers.livox.commands import (
    MID360,
    Discovered,
    ReadReply,
    ReturnCode,
    WriteReply,
    decode_keys,
    decode_raw_values,
    encode_discovered,
    encode_read_reply,
    encode_values,
    encode_write_reply,
)
from drivers.livox.frames import Command, Frame, Kind, Sender, encode
from drivers.livox.keys import PARAMETERS, Endpoint, Key, Network, Value, decode_value, writable
from drivers.livox.status import WorkState
from drivers.sim.livox_states import StateMachine

RANGES: dict[int, tuple[int, ...]] = {
    Key.POINT_TYPE: (1, 2, 3),
    Key.PATTERN: (0,),
    Key.FOV_ENABLE: (0, 1, 2, 3),
    Key.DETECT_MODE: (0, 1),
    Key.WORK_TARGET: (WorkState.SAMPLING, WorkState.IDLE, WorkState.READY),
    Key.IMU_ENABLE: (0, 1),
}
PUSHES_PER_S_BY_SEQUENCE = 26
"""The push's own counter advances by so many a second (reference sheet, section 6)."""


@dataclass(frozen=True, slots=True)
class DeviceOptions:
    """One LiDAR. `stored_host` is where it streams to until it is told otherwise; empty: the factory's 192.168.1.5.

    uptime_s: how long it has been on when the emulator starts; below 11 s it is seen starting.
    time_scale: 0.1 makes starting and rebooting ten times as fast as on the hardware.
    """

    serial: str = "EMULATED000001"
    stored_host: str = ""
    uptime_s: float = 4100.0
    time_scale: float = 1.0
    drift_ppm: float = 12.5
    temperature_c: float = 59.8
    hms: tuple[int, ...] = ()
    device_type: int = MID360
    firmware_type: int = 1
    command_port: int = 56100
    seed: int = 0


def _factory(options: DeviceOptions, address: str) -> dict[int, Value]:
    host = options.stored_host or "192.168.1.5"
    return {
        Key.POINT_TYPE: 1,
        Key.PATTERN: 0,
        Key.NETWORK: Network(address, "255.255.255.0", "192.168.1.1"),
        Key.STATUS_HOST: Endpoint(options.stored_host or "255.255.255.255", 56201, 56200),
        Key.POINT_HOST: Endpoint(host, 56301, 56300),
        Key.IMU_HOST: Endpoint(host, 56401, 56400),
        Key.ATTITUDE: (0.0, 0.0, 0.0, 0, 0, 0),
        Key.FOV_0: (0, 360, -10, 60, 0),
        Key.FOV_1: (0, 360, -10, 60, 0),
        Key.FOV_ENABLE: 0,
        Key.DETECT_MODE: 0,
        Key.IO: (0, 0, 0, 0),
        Key.WORK_TARGET: int(WorkState.SAMPLING),
        Key.IMU_ENABLE: 1,
        Key.SERIAL: options.serial,
        Key.PRODUCT: "DevType:Mid-360 FmType:App FmVer:13180244 BuildTime:2025-03-07",
        Key.VERSION_APP: (13, 18, 2, 44),
        Key.VERSION_LOADER: (13, 0, 0, 1),
        Key.VERSION_HARDWARE: (0, 0, 0, 0),
        Key.MAC: (0xE4, 0x7A, 0x2C, 0x00, 0x00, 0x01),
        Key.LAST_SYNC: 0,
        Key.TIME_OFFSET: 0,
        Key.TIME_SYNC: 0,
        Key.DIAGNOSIS: 0,
        Key.FIRMWARE_TYPE: options.firmware_type,
    }


class LivoxDevice:
    """State and parameters of one device. Times are host CLOCK_MONOTONIC ns, passed in."""

    def __init__(self, options: DeviceOptions, address: str, now_ns: int) -> None:
        self.options = options
        self.address = address
        self.machine = StateMachine(now_ns - round(options.uptime_s * 1e9), options.time_scale)
        self._values = _factory(options, address)
        self._power_ups = 17

    def answer(self, frame: Frame, now_ns: int) -> bytes | None:
        """Answer to a command on the command port, as bytes; None when it gives none."""
        if frame.kind is not Kind.REQUEST or frame.sender is not Sender.HOST:
            return None
        data = self._answer_data(frame, now_ns)
        if data is None:
            return None
        return encode(Frame(frame.command, frame.sequence, Kind.ACK, Sender.LIDAR, data))

    def discovered(self, frame: Frame) -> bytes | None:
        """Answer to a command on the discovery port, None when it is no discovery."""
        if frame.command != Command.DISCOVER or frame.kind is not Kind.REQUEST:
            return None
        options = self.options
        answer = Discovered(0, options.device_type, options.serial, self.address, options.command_port)
        return encode(Frame(Command.DISCOVER, frame.sequence, Kind.ACK, Sender.LIDAR, encode_discovered(answer)))

    def push(self, now_ns: int) -> bytes:
        """The status: exactly 30 keys in 401 bytes, numbered by a counter that restarts with the device."""
        sequence = (now_ns - self.machine.power_on_ns) * PUSHES_PER_S_BY_SEQUENCE // 1_000_000_000
        data = encode_values(self.values(now_ns))
        return encode(Frame(Command.PUSH, max(0, sequence), Kind.REQUEST, Sender.LIDAR, data))

    def values(self, now_ns: int) -> dict[int, Value]:
        """All parameters, in order of their keys."""
        values = self._values | {
            Key.WORK_STATE: int(self.machine.state),
            Key.CORE_TEMPERATURE: round(self.options.temperature_c * 100),
            Key.POWER_UPS: self._power_ups + self.machine.reboots,
            Key.LOCAL_TIME: max(0, now_ns - self.machine.power_on_ns),
            Key.HMS: (*self.options.hms, *(0,) * 8)[:8],
        }
        return dict(sorted(values.items()))

    def setting(self, key: Key) -> Value:
        """One parameter that does not change by itself."""
        return self._values[key]

    def _answer_data(self, frame: Frame, now_ns: int) -> bytes | None:
        if frame.command == Command.WRITE:
            return encode_write_reply(self._write(frame.data, now_ns))
        if frame.command == Command.READ:
            return encode_read_reply(self._read(frame.data, now_ns))
        if frame.command in (Command.REBOOT, Command.FACTORY_RESET):
            delay_ms = struct.unpack("<H", frame.data)[0] if len(frame.data) == 2 else 0
            self.machine.reboot(now_ns + delay_ms * 1_000_000)
            return bytes((ReturnCode.OK,))
        if frame.command == Command.GPS_TIME:
            return bytes((ReturnCode.OK if len(frame.data) == 9 else ReturnCode.BAD_LENGTH,))
        return None

    def _read(self, data: bytes, now_ns: int) -> ReadReply:
        """A mix of known and unknown keys is refused as unsupported, and the known ones are answered all the same."""
        try:
            keys = decode_keys(data)
        except ProtocolError:
            return ReadReply(ReturnCode.BAD_COUNT, {})
        values = self.values(now_ns)
        known = {key: values[key] for key in keys if key in values}
        return ReadReply(ReturnCode.OK if len(known) == len(set(keys)) else ReturnCode.UNSUPPORTED, known)

    def _write(self, data: bytes, now_ns: int) -> WriteReply:
        """All of a frame or nothing of it."""
        try:
            raw = decode_raw_values(data)
        except ProtocolError:
            return WriteReply(ReturnCode.BAD_COUNT, 0)
        for key, value in raw.items():
            code = _objection(key, value)
            if code != ReturnCode.OK:
                return WriteReply(code, key)
        self._apply({key: decode_value(key, value) for key, value in raw.items()}, now_ns)
        return WriteReply(ReturnCode.AFTER_REBOOT if Key.NETWORK in raw else ReturnCode.OK, 0)

    def _apply(self, values: Mapping[int, Value], now_ns: int) -> None:
        self._values.update(values)
        if Key.WORK_TARGET in values:
            self.machine.aim(WorkState(values[Key.WORK_TARGET]), now_ns)


def _objection(key: int, raw: bytes) -> ReturnCode:
    """Why a write is refused, OK when it is not. 0x002B, 0x0026 and 0x0009 are among the unknown on a Mid-360."""
    parameter = PARAMETERS.get(key)
    if parameter is None:
        return ReturnCode.UNSUPPORTED
    if not writable(key):
        return ReturnCode.READ_ONLY
    if len(raw) != parameter.length:
        return ReturnCode.BAD_LENGTH
    if key in RANGES and decode_value(key, raw) not in RANGES[key]:
        return ReturnCode.OUT_OF_RANGE
    return ReturnCode.OK
