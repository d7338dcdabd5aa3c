"""A Mid-360 on loopback: speaks the protocol from the device's side, in real time, with faults on demand."""

from __future__ import annotations

import contextlib
import json
import selectors
import socket
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TextIO

from drivers.errors import ProtocolError, SimulationError
from drivers.livox.frames import LONGEST_BYTES, Command, Frame, decode
from drivers.livox.keys import Key
from drivers.livox.packets import PACKET_NS
from drivers.sim.faults import FaultPlan
from drivers.sim.livox_channel import Channel, Stream, deliver, levels
from drivers.sim.livox_device import DeviceOptions, LivoxDevice
from drivers.sim.livox_oscillator import Oscillator
from drivers.sim.livox_states import FIRST_PACKET_S
from drivers.sim.livox_streams import IMU_NS, ImuStream, PointStream
from drivers.sim.sources import ImuSource, LidarSource, StopFlag

ADDRESS = "127.0.1.10"
BROADCAST = "127.255.255.255"
DISCOVERY_PORT, STATUS_PORT, POINT_PORT, IMU_PORT = 56000, 56200, 56300, 56400
PACE_NS = 5 * PACKET_NS
"""Packets leave in bursts of five; the last of each burst leaves when it is complete."""
PACE_DELAYED_NS = 1_000_000
PUSH_NS = 1_000_000_000
EXTRA_PUSH_NS = 15_000_000
"""Every write is followed by a push of its own within 20 ms."""
TRUTH_NS = 100_000_000


def run(
    lidar: LidarSource,
    imu: ImuSource,
    plan: FaultPlan,
    epoch_ns: int,
    stop: StopFlag,
    *,
    address: str = ADDRESS,
    truth_path: Path | None = None,
    options: DeviceOptions | None = None,
    ready: Callable[[], None] = lambda: None,
) -> None:
    """Emulate until `stop` is set. Body of a process or of a thread.

    epoch_ns: CLOCK_MONOTONIC at which walk time is 0; data flow from then on, and faults count from it.
    truth_path: where its true clock goes, one JSON line {"host_ns", "sensor_ns"} every 0.1 s.
    ready: called once the sockets are bound. SimulationError when they cannot be.
    """
    Emulator(lidar, imu, plan, epoch_ns, address=address, options=options).run(stop, truth_path, ready)


class Emulator:
    """One emulated device. `points` and `imu` tell what was sent and what was done to it."""

    def __init__(
        self,
        lidar: LidarSource,
        imu: ImuSource,
        plan: FaultPlan,
        epoch_ns: int,
        *,
        address: str = ADDRESS,
        options: DeviceOptions | None = None,
    ) -> None:
        now_ns = time.monotonic_ns()
        self._options = options or DeviceOptions()
        self._plan = plan
        self._epoch_ns = epoch_ns
        self._address = address
        self._caster = ThreadPoolExecutor(1, "livox-cast")
        self.device = LivoxDevice(self._options, address, now_ns)
        self._oscillator = Oscillator(self.device.machine.power_on_ns, self._options.drift_ppm)
        self._point_stream = PointStream(lidar, self._oscillator, epoch_ns, self._caster)
        self._imu_stream = ImuStream(imu, self._oscillator, epoch_ns, self._options.seed)
        sampled_ns = max(0, round((self._options.uptime_s - FIRST_PACKET_S) * 1e9))
        self._point_stream.count, self._imu_stream.count = sampled_ns // PACKET_NS, sampled_ns // IMU_NS
        self._channel = Channel(self._options.seed)
        self._flowing = False
        self._push_ns = now_ns
        self._extra_push_ns: int | None = None
        self._truth_ns = now_ns
        self._last_turn_ns = now_ns
        self._commander: tuple[str, int] | None = None
        self._truth: TextIO | None = None

    def run(self, stop: StopFlag, truth_path: Path | None = None, ready: Callable[[], None] = lambda: None) -> None:
        """Emulate until `stop` is set."""
        with contextlib.ExitStack() as stack:
            stack.callback(self._caster.shutdown, cancel_futures=True)
            self._open(stack)
            if truth_path is not None:
                self._truth = stack.enter_context(truth_path.open("w", encoding="utf-8"))
            ready()
            while not stop.is_set():
                self._turn(time.monotonic_ns())

    def _open(self, stack: contextlib.ExitStack) -> None:
        def bound(host: str, port: int) -> socket.socket:
            made = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            made.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            try:
                made.bind((host, port))
            except OSError as error:
                raise SimulationError(f"the emulated LiDAR cannot use {host}:{port}: {error.strerror}") from error
            made.setblocking(False)
            return made

        if not self._address.startswith("127."):
            raise SimulationError(f"the emulated LiDAR lives on loopback only, and {self._address} is not")
        self._discovery = bound(self._address, DISCOVERY_PORT)
        self._discovery_broadcast = bound(BROADCAST, DISCOVERY_PORT)
        self._commands = bound(self._address, self._options.command_port)
        self._status = bound(self._address, STATUS_PORT)
        self.points = Stream(bound(self._address, POINT_PORT))
        self.imu = Stream(bound(self._address, IMU_PORT))
        self._selector = stack.enter_context(selectors.DefaultSelector())
        for inbox in (self._discovery, self._discovery_broadcast, self._commands):
            self._selector.register(inbox, selectors.EVENT_READ)

    def _turn(self, now_ns: int) -> None:
        """One round: faults, states, what is due, and then the host's questions until the next round."""
        t_s = (now_ns - self._epoch_ns) / 1e9
        self._apply_faults(now_ns, t_s)
        if self.device.machine.advance(now_ns):
            self._oscillator.restart(self.device.machine.power_on_ns)
            self._point_stream.count = self._imu_stream.count = 0
        stalled = self._plan.active("stall", t_s)
        self._stream(now_ns, paused=stalled or not self.device.machine.streaming or t_s < 0)
        quiet = stalled or self._channel.levels.cut or not self.device.machine.reachable
        self._push(now_ns, quiet)
        next_late_ns = self._channel.release(now_ns)
        self._write_truth(now_ns)
        pace_ns = PACE_NS if next_late_ns is None else PACE_DELAYED_NS
        spent_ns = time.monotonic_ns() - now_ns
        for key, _ in self._selector.select(max(0, pace_ns - spent_ns) / 1e9):
            assert isinstance(key.fileobj, socket.socket)
            self._hear(key.fileobj, quiet)

    def _apply_faults(self, now_ns: int, t_s: float) -> None:
        plan = self._plan
        self._channel.levels = levels(plan, t_s)
        self._oscillator.drift(plan.level("clock_drift", t_s), now_ns)
        for fault in plan.due("clock_step", t_s):
            self._oscillator.step(round(fault.value * 1e9))
        for _ in plan.due("reboot", t_s):
            self.device.machine.reboot(now_ns)
        if self._channel.levels.garbage_hz:
            self._litter((now_ns - self._last_turn_ns) / 1e9)
        self._last_turn_ns = now_ns

    def _litter(self, elapsed_s: float) -> None:
        sockets = [self.points.socket, self.imu.socket, self._status, self._commands]
        to = [(host.address, host.port) for host in map(self.device.setting, _DESTINATIONS)]
        if self._commander is not None:
            to.append(self._commander)
        self._channel.litter(sockets, to, elapsed_s)

    def _stream(self, now_ns: int, paused: bool) -> None:
        """Send the packets that are due. During a pause none are made, and the counters stand still."""
        if paused:
            if self._flowing:
                self._point_stream.end()
            self._flowing = False
            return
        if not self._flowing:
            self._flowing = True
            self._point_stream.begin(now_ns)
            self._imu_stream.begin(now_ns)
        device, send = self.device, self._channel.send
        host = device.setting(Key.POINT_HOST)
        for packet in self._point_stream.due(now_ns, device.setting(Key.POINT_TYPE)):
            send(self.points, packet, (host.address, host.port), now_ns)
        if device.setting(Key.IMU_ENABLE):
            host = device.setting(Key.IMU_HOST)
            for sample in self._imu_stream.due(now_ns):
                send(self.imu, sample, (host.address, host.port), now_ns)

    def _push(self, now_ns: int, quiet: bool) -> None:
        extra = self._extra_push_ns is not None and now_ns >= self._extra_push_ns
        if not extra and now_ns < self._push_ns:
            return
        if extra:
            self._extra_push_ns = None
        else:
            self._push_ns = max(self._push_ns + PUSH_NS, now_ns)
        if not quiet:
            host = self.device.setting(Key.STATUS_HOST)
            address = BROADCAST if host.address == "255.255.255.255" else host.address
            deliver(self._status, self.device.push(now_ns), (address, host.port))

    def _hear(self, inbox: socket.socket, quiet: bool) -> None:
        """Take one datagram; nothing but a sound command is answered, and nothing at all while quiet."""
        try:
            datagram, sender = inbox.recvfrom(LONGEST_BYTES)
            frame = decode(datagram)
        except (ProtocolError, OSError):
            return
        if quiet:
            return
        if inbox is self._commands:
            self._obey(frame, sender)
        else:
            answer = self.device.discovered(frame)
            if answer is not None:  # broadcast to the port of the question, even when asked in private
                deliver(self._discovery, answer, (BROADCAST, sender[1]))

    def _obey(self, frame: Frame, sender: tuple[str, int]) -> None:
        now_ns = time.monotonic_ns()
        answer = self.device.answer(frame, now_ns)
        if answer is None:
            return
        self._commander = sender
        deliver(self._commands, answer, sender)
        if frame.command == Command.WRITE:
            self._extra_push_ns = now_ns + EXTRA_PUSH_NS

    def _write_truth(self, now_ns: int) -> None:
        if self._truth is None or now_ns < self._truth_ns:
            return
        self._truth_ns = now_ns + TRUTH_NS
        sensor_ns = self._oscillator.stamp_ns(self._oscillator.ticks_ns(now_ns))
        self._truth.write(json.dumps({"host_ns": now_ns, "sensor_ns": sensor_ns}) + "\n")
        self._truth.flush()


_DESTINATIONS = (Key.STATUS_HOST, Key.POINT_HOST, Key.IMU_HOST)
