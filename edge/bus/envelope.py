"""One message on the bus: topic, head, CDR. Stamps are host time (`CLOCK_MONOTONIC`), in the CDR as well.

Sequence numbers count per topic from the recorder's start; what is missing between two was dropped.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from edge.errors import FormatError

_HEAD = struct.Struct("<Qqq")


@dataclass(frozen=True, slots=True)
class Envelope:
    """data: CDR of the topic's type, as in a recording."""

    topic: str
    sequence: int
    receive_ns: int
    stamp_ns: int
    data: bytes | memoryview

    def parts(self) -> list[bytes | memoryview]:
        """As ZeroMQ sends it. The topic ends with a NUL: subscriptions match by prefix."""
        return [self.topic.encode() + b"\0", _HEAD.pack(self.sequence, self.receive_ns, self.stamp_ns), self.data]


def unpacked(parts: list[bytes]) -> Envelope:
    """FormatError for what is no message of the bus."""
    if len(parts) != 3 or len(parts[1]) != _HEAD.size or not parts[0].endswith(b"\0"):
        raise FormatError(f"not a message of the bus: {len(parts)} parts, beginning with {parts[0][:40]!r}")
    sequence, receive_ns, stamp_ns = _HEAD.unpack(parts[1])
    return Envelope(parts[0][:-1].decode("utf-8", "replace"), sequence, receive_ns, stamp_ns, parts[2])


def subscription(topic: str) -> bytes:
    """What to subscribe to for one topic."""
    return topic.encode() + b"\0"
