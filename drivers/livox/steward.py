"""Finds the LiDAR, configures it, starts it, and looks after it for ever."""

from __future__ import annotations

import contextlib
import select
import socket
import time
from collections.abc import Callable
from dataclasses import replace
from threading import Event

from drivers.driver import SensorState
from drivers.errors import DriverError, ProtocolError, SensorRefused, SensorUnreachable, SensorUnsupported
from drivers.livox.commands import DEVICE_NAMES, MID360
from drivers.livox.config import Config
from drivers.livox.control import ControlLink
from drivers.livox.discovery import Found, StatusListener, ask, discover
from drivers.livox.hms import explain
from drivers.livox.keys import Endpoint, Key, Value
from drivers.livox.packets import DataType
from drivers.livox.receive import Receiver
from drivers.livox.status import Identity, Status, WorkState, read_identity, read_status
from drivers.messages import Severity

IDENTITY_KEYS = (Key.SERIAL, Key.PRODUCT, Key.VERSION_APP, Key.MAC, Key.WORK_STATE, Key.FIRMWARE_TYPE)
STATUS_KEYS = (
    Key.POINT_HOST,
    Key.IMU_HOST,
    Key.SERIAL,
    Key.WORK_STATE,
    Key.CORE_TEMPERATURE,
    Key.POWER_UPS,
    Key.TIME_SYNC,
    Key.HMS,
)
POINT_TYPES = {
    "cartesian_32": DataType.CARTESIAN_32,
    "cartesian_16": DataType.CARTESIAN_16,
    "spherical": DataType.SPHERICAL,
}
STOP_STATES = {"idle": WorkState.IDLE, "ready": WorkState.READY}
STARTING_STATES = (None, WorkState.SELFCHECK, WorkState.MOTOR_STARTUP, WorkState.UPGRADE)
"""States that end by themselves."""
PUSH_OVERDUE_S = 3.0
"""The status comes once a second; when it does not, it is asked for."""
STOP_TIMEOUT_S = 0.5

Note = Callable[[Severity, str], None]
"""Takes something worth keeping in the file."""


class Steward:
    """The control side of one LiDAR. Its fields are written by its own thread and read by any.

    `last_data_ns` tells when data last came; `note` takes events.
    """

    def __init__(self, config: Config, receiver: Receiver, last_data_ns: Callable[[], int | None], note: Note) -> None:
        self._config = config
        self._receiver = receiver
        self._last_data_ns = last_data_ns
        self._note = note
        self._configure_again = Event()
        self._connected = False
        self._repeated = False
        self._status_ns = 0
        self._configured_ns = 0
        self.state = SensorState.SEARCHING
        self.problem = "looking for the LiDAR"
        self.advice = ""
        self.address = config.address
        self.identity: Identity | None = None
        self.status: Status | None = None

    def request_configuration(self) -> None:
        """Write the configuration again soon: the LiDAR seems to have started anew. From any thread."""
        self._configure_again.set()

    def status_age_s(self) -> float:
        """Time since the LiDAR last said how it is."""
        return _age_s(self._status_ns)

    def run(self, stop: Event) -> None:
        """Thread body."""
        while not stop.is_set():
            try:
                self._serve(stop)
            except (SensorRefused, SensorUnsupported) as error:
                self._fall(SensorState.FAILED, error)
            except (SensorUnreachable, ProtocolError) as error:
                self._fall(SensorState.SEARCHING, error)
            stop.wait(self._config.retry_s)

    def _serve(self, stop: Event) -> None:
        """From searching to looking after; ends by an error, or with `stop`."""
        config = self._config
        with contextlib.closing(StatusListener(config)) as listener:
            found = self._find(listener, stop)
            if found is None:
                return
            self.address = found.address
            host = config.host_address or _route_to(found.address)
            ports = (config.host_point_port, config.host_imu_port)
            self._receiver.open(host, ports, config.receive_buffer_bytes)
            self._receiver.accept_from(found.address)
            with self._link(found, host) as link:
                self._identify(link, found)
                self._configure(link, host)
                self._connected_to(found)
                self._watch(link, host, listener, stop)
            with self._link(found, host, hurried=True) as link:
                self._leave(link)

    def _find(self, listener: StatusListener, stop: Event) -> Found | None:
        """The LiDAR, None when told to stop. SensorUnreachable when nobody answers."""
        config = self._config
        if config.address:
            found = ask(config, stop)
            return found or Found(config.address, config.command_port, "", MID360)
        while not stop.is_set():
            found = discover(config, listener, stop)
            if found is not None:
                return found
            wanted = f" with serial number {config.serial_number}" if config.serial_number else ""
            self._fall(SensorState.SEARCHING, SensorUnreachable(f"no Livox LiDAR{wanted} answers or is heard"))
        return None

    def _link(self, found: Found, host: str, hurried: bool = False) -> ControlLink:
        config = self._config
        timeout_s, attempts = (STOP_TIMEOUT_S, 2) if hurried else (config.reply_timeout_s, config.attempts)
        return ControlLink((host, config.host_command_port), (found.address, found.command_port), timeout_s, attempts)

    def _identify(self, link: ControlLink, found: Found) -> None:
        """Refuse what this driver does not speak to."""
        if found.device_type != MID360:
            name = DEVICE_NAMES.get(found.device_type, f"device type {found.device_type}")
            raise SensorUnsupported(f"the LiDAR at {found.address} is a {name}; this driver speaks to the Mid-360 only")
        values = link.read(IDENTITY_KEYS)
        self.identity = read_identity(values)
        if self.identity.in_loader:
            raise SensorUnsupported(
                f"the LiDAR at {found.address} is stuck in its loader and cannot measure; "
                "write its firmware anew with Livox Viewer"
            )
        wanted = self._config.serial_number
        if wanted and self.identity.serial != wanted:
            raise SensorUnsupported(
                f"the LiDAR at {found.address} is {self.identity.serial}, and {wanted} is configured"
            )

    def _configure(self, link: ControlLink, host: str) -> None:
        """Point the streams to this host in one frame, then what to send and to start.

        Always rewritten: the LiDAR stores it, and another host may have changed it.
        """
        self._configure_again.clear()
        config = self._config
        destinations: dict[int, Value] = {
            Key.STATUS_HOST: Endpoint(host, config.host_status_port, config.status_source_port),
            Key.POINT_HOST: Endpoint(host, config.host_point_port, config.point_source_port),
            Key.IMU_HOST: Endpoint(host, config.host_imu_port, config.imu_source_port),
        }
        start: dict[int, Value] = {
            Key.POINT_TYPE: POINT_TYPES[config.point_type],
            Key.IMU_ENABLE: 1,
            Key.WORK_TARGET: WorkState.SAMPLING,
        }
        for values in (destinations, start):
            text = link.write(values)
            if text:
                self._note(Severity.INFO, f"configuration of the LiDAR: {text}")
        self._configured_ns = self._status_ns = time.monotonic_ns()
        self.state, self.problem, self.advice = SensorState.STARTING, "", ""

    def _watch(self, link: ControlLink, host: str, listener: StatusListener, stop: Event) -> None:
        """Follow the status; configure again after a restart or when the data do not come."""
        while not stop.is_set():
            select.select(listener.sockets, [], [], 0.2)
            for sender, values in listener.pushes():
                if sender == self.address:
                    self._heard(read_status(values))
            if self.status_age_s() > PUSH_OVERDUE_S:
                self._heard(read_status(link.read(STATUS_KEYS)))
            if self._configure_again.is_set():
                self._configure(link, host)
            self._mind_silence(link, host)

    def _mind_silence(self, link: ControlLink, host: str) -> None:
        data_ns = self._last_data_ns() or 0
        starting = self.status is None or self.status.work_state in STARTING_STATES
        patience_s = self._config.start_timeout_s if starting else self._config.silence_s
        if _age_s(max(self._configured_ns, data_ns)) > patience_s:
            if data_ns > self._configured_ns or not self._repeated:
                self._note(Severity.WARNING, "the LiDAR answers but sends no points; configuring it again")
            self._repeated = data_ns <= self._configured_ns
            self._configure(link, host)

    def _heard(self, status: Status) -> None:
        """Take a status in; a health code that is new is worth an event."""
        known = self.status.hms if self.status else ()
        for finding in (explain(code) for code in status.hms if code not in known):
            if finding.fault:
                self._note(Severity.WARNING, f"LiDAR: {finding.text} ({finding.code:#010x})")
        self.status = status
        self._status_ns = time.monotonic_ns()

    def _connected_to(self, found: Found) -> None:
        self._connected = True
        if self.identity is not None:
            serial, firmware = self.identity.serial, self.identity.firmware
            self._note(Severity.INFO, f"connected to Mid-360 {serial} at {found.address}, firmware {firmware}")

    def _leave(self, link: ControlLink) -> None:
        """Leave the LiDAR as the configuration says."""
        target = STOP_STATES.get(self._config.stop_state)
        if target is not None:
            with contextlib.suppress(DriverError):  # it may be switched off already, which is as good
                link.write({Key.WORK_TARGET: target})

    def _fall(self, state: SensorState, error: DriverError) -> None:
        text, _, advice = str(error).partition("; ")
        self.state, self.problem, self.advice = state, text, advice
        if self.status is not None:
            self.status = replace(self.status, work_state=None)
        if self._connected:
            self._note(Severity.WARNING, f"lost the LiDAR: {text}")
        self._connected = False


def _route_to(address: str) -> str:
    """Address of this host on the way to the LiDAR. SensorUnreachable when there is no way."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((address, 9))
        except OSError as error:
            raise SensorUnreachable(f"there is no route to the LiDAR at {address}: {error.strerror}") from error
        return str(probe.getsockname()[0])


def _age_s(since_ns: int) -> float:
    return (time.monotonic_ns() - since_ns) / 1e9
