"""Bytes to sentences: everything a receiver's line may carry between two of them is dropped and counted."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from enum import Enum

MAX_BYTES = 256
"""Longest sentence kept, from `$` to the checksum. A Reach GGA has 84 bytes, above the 82 of the standard."""

_END = re.compile(rb"[^\x20-\x23\x25-\x7e]")
"""What ends a candidate: a line end, another `$`, or a byte no sentence holds (UBX and RTCM between sentences)."""
_SENTENCE = re.compile(rb"\$([^*]+)\*([0-9A-Fa-f]{2})")


class Rejection(Enum):
    """Why a candidate, the bytes after a `$`, is no sentence."""

    INTERRUPTED = "interrupted"
    """Another `$` before the line end."""
    NOT_TEXT = "not text"
    TOO_LONG = "too long"
    NO_CHECKSUM = "no checksum"
    BAD_CHECKSUM = "bad checksum"


@dataclass(frozen=True, slots=True)
class Frame:
    """One sentence from `$` to its checksum, without the line end; `receive_ns` belongs to the byte `$`."""

    sentence: str
    receive_ns: int


class Framer:
    """Cuts a byte stream into sentences. The result does not depend on how the stream was cut into chunks."""

    def __init__(self) -> None:
        self.rejected: Counter[Rejection] = Counter()
        self.noise_bytes = 0
        """Bytes outside any candidate, line ends not counted."""
        self._pending = b""
        self._pending_ns = 0

    def feed(self, data: bytes, receive_ns: int) -> list[Frame]:
        """Sentences completed by `data`, which arrived at `receive_ns` (monotonic)."""
        frames: list[Frame] = []
        carried = len(self._pending)
        buffer = self._pending + data
        at = 0
        while (start := buffer.find(b"$", at)) >= 0:
            self._skip(buffer[at:start])
            end = _END.search(buffer, start + 1)
            # Cut right above the limit: what follows counts as noise, however it was cut into chunks.
            stop = min(len(buffer) if end is None else end.start(), start + MAX_BYTES + 1)
            if end is None and stop - start <= MAX_BYTES:
                self._keep(buffer[start:], self._pending_ns if start < carried else receive_ns)
                return frames
            sentence = self._judge(buffer[start:stop], buffer[stop : stop + 1])
            if sentence:
                frames.append(Frame(sentence, self._pending_ns if start < carried else receive_ns))
            at = stop
        self._skip(buffer[at:])
        self._keep(b"", 0)
        return frames

    def reset(self) -> None:
        """Forget a begun sentence: the link was opened anew."""
        self._keep(b"", 0)

    def _judge(self, candidate: bytes, end: bytes) -> str:
        """The sentence, or nothing and a count of why."""
        rejection = _rejection(candidate, end)
        if rejection is not None:
            self.rejected[rejection] += 1
            return ""
        return candidate.decode("ascii")

    def _keep(self, pending: bytes, receive_ns: int) -> None:
        self._pending, self._pending_ns = pending, receive_ns

    def _skip(self, noise: bytes) -> None:
        self.noise_bytes += len(noise.translate(None, b"\r\n"))


def checksum(body: bytes) -> int:
    """Exclusive or of the bytes between `$` and `*`."""
    value = 0
    for byte in body:
        value ^= byte
    return value


def _rejection(candidate: bytes, end: bytes) -> Rejection | None:
    if len(candidate) > MAX_BYTES:
        return Rejection.TOO_LONG
    if end == b"$":
        return Rejection.INTERRUPTED
    if end not in (b"\r", b"\n"):
        return Rejection.NOT_TEXT
    match = _SENTENCE.fullmatch(candidate)
    if match is None:
        return Rejection.NO_CHECKSUM
    return None if checksum(match[1]) == int(match[2], 16) else Rejection.BAD_CHECKSUM
