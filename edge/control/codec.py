"""Lines of the control socket: bytes to messages and back."""

from __future__ import annotations

import msgspec

from edge.control.messages import PROTOCOL_VERSION, Line, Reply, Request, Status
from edge.errors import ControlError

REQUEST_LIMIT = 16 * 1024
"""Bytes of a request, line end included: a mark's text is the only long field."""
LINE_LIMIT = 1024 * 1024
"""Bytes of a line from the recorder. A full status is about 5 kB."""

_ENCODER = msgspec.json.Encoder()
_LINES: msgspec.json.Decoder[Request | Reply | Status] = msgspec.json.Decoder(Line)
_REQUESTS = msgspec.json.Decoder(Request)


class Envelope(msgspec.Struct, frozen=True):
    """What every version of a request has: enough to answer one that is not understood."""

    id: int = 0
    version: int = PROTOCOL_VERSION
    """A person typing JSON need not say it."""


_ENVELOPES = msgspec.json.Decoder(Envelope)


def encode(line: Line) -> bytes:
    """One line, its end included. JSON escapes line ends inside texts."""
    return _ENCODER.encode(line) + b"\n"


def decode(line: bytes) -> Request | Reply | Status:
    """ControlError when the line is no message of this protocol."""
    try:
        return _LINES.decode(line)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ControlError(f"not a line of the control protocol: {error}") from error


def decode_request(line: bytes) -> Request:
    """ControlError when the line is no request of this protocol."""
    try:
        return _REQUESTS.decode(line)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ControlError(f"not a request of the control protocol: {error}") from error


def decode_envelope(line: bytes) -> Envelope:
    """Id and version of a request, whatever else is in it; the defaults when even these cannot be read."""
    try:
        return _ENVELOPES.decode(line)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return Envelope()


class LineSplitter:
    """Bytes in any pieces to whole lines, bounded."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._rest = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """The lines completed by `data`, without their ends. ControlError past the limit."""
        self._rest += data
        *lines, rest = self._rest.split(b"\n")
        self._rest = rest
        if max(map(len, (*lines, rest))) >= self._limit:
            raise ControlError(f"a line of {self._limit} bytes or more on the control socket")
        return [bytes(line) for line in lines]
