"""Talking to the LiDAR: one socket, requests that are repeated until they are answered."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterable, Mapping
from types import TracebackType

from drivers.errors import ProtocolError, SensorRefused, SensorUnreachable
from drivers.livox.commands import (
    RETURN_TEXTS,
    ReturnCode,
    decode_read_reply,
    decode_write_reply,
    encode_keys,
    encode_values,
)
from drivers.livox.frames import LONGEST_BYTES, Command, Frame, Kind, Sender, decode, encode
from drivers.livox.keys import PARAMETERS, Value

SUCCESS = (ReturnCode.OK, ReturnCode.AFTER_REBOOT)


class ControlLink:
    """Requests and answers of one LiDAR. Not thread-safe."""

    def __init__(self, host: tuple[str, int], lidar: tuple[str, int], timeout_s: float, attempts: int) -> None:
        """Binds `host`. SensorUnreachable when this host cannot."""
        self._lidar = lidar
        self._timeout_s = timeout_s
        self._attempts = attempts
        self._sequence = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(host)
        except OSError as error:
            self._socket.close()
            raise SensorUnreachable(f"cannot send commands from {host[0]}:{host[1]}: {error.strerror}") from error

    def __enter__(self) -> ControlLink:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()

    def read(self, keys: Iterable[int]) -> dict[int, Value]:
        """Values of parameters; those the firmware does not know are absent (it answers UNSUPPORTED, with the rest)."""
        reply = decode_read_reply(self.request(Command.READ, encode_keys(keys)))
        if reply.return_code not in (*SUCCESS, ReturnCode.UNSUPPORTED) and not reply.values:
            raise SensorRefused(f"{self._who} refused to be read: {_reason(reply.return_code)}")
        return reply.values

    def write(self, values: Mapping[int, Value]) -> str:
        """Set parameters in one frame, which the LiDAR applies at once. Returns a note, empty when there is none.

        SensorRefused names the parameter and the reason.
        """
        reply = decode_write_reply(self.request(Command.WRITE, encode_values(values)))
        if reply.return_code not in SUCCESS:
            about = PARAMETERS.get(reply.error_key)
            name = about.name if about else f"parameter {reply.error_key:#06x}"
            raise SensorRefused(f"{self._who} refused to set {name}: {_reason(reply.return_code)}")
        return "" if reply.return_code == ReturnCode.OK else RETURN_TEXTS[reply.return_code]

    def request(self, command: Command, data: bytes) -> bytes:
        """Data of the answer. SensorUnreachable when none comes; each attempt has its own sequence number."""
        sent: set[int] = set()
        for _ in range(self._attempts):
            self._sequence = self._sequence % 0xFFFF + 1
            sent.add(self._sequence)
            frame = Frame(command, self._sequence, Kind.REQUEST, Sender.HOST, data)
            try:
                self._socket.sendto(encode(frame), self._lidar)
            except OSError as error:
                raise SensorUnreachable(f"{self._who} cannot be reached: {error.strerror}") from error
            answer = self._answer(command, sent)
            if answer is not None:
                return answer
        raise SensorUnreachable(
            f"{self._who} does not answer ({self._attempts} attempts, {self._timeout_s:g} s each); "
            "check its power, the cable, and that this host has an address in its network"
        )

    @property
    def _who(self) -> str:
        return f"the LiDAR at {self._lidar[0]}:{self._lidar[1]}"

    def _answer(self, command: Command, sent: set[int]) -> bytes | None:
        """The matching ACK within the timeout; everything else that comes is passed over."""
        deadline = time.monotonic() + self._timeout_s
        while (left := deadline - time.monotonic()) > 0:
            self._socket.settimeout(left)
            try:
                datagram, sender = self._socket.recvfrom(LONGEST_BYTES)
                frame = decode(datagram)
            except TimeoutError:
                return None
            except (ProtocolError, OSError):  # damaged, or an ICMP error of an earlier request
                continue
            ours = sender[0] == self._lidar[0] and frame.sequence in sent
            if ours and frame.kind is Kind.ACK and frame.command == command:
                return frame.data
        return None


def _reason(code: int) -> str:
    return RETURN_TEXTS.get(code, f"return code {code:#04x}")
