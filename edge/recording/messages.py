"""What the recorder itself adds to a recording. Stamps are host time, as in `drivers.messages`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

from drivers.messages import Message


class Level(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class DiagnosticStatus:
    """State of one part: a sensor, its clock, the disk, the queue. `values` are (key, value) pairs."""

    name: str
    level: Level
    message: str = ""
    hardware_id: str = ""
    values: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Diagnostics:
    """The state of everything at one instant, about once a second."""

    stamp_ns: int
    receive_ns: int
    statuses: tuple[DiagnosticStatus, ...]


@dataclass(frozen=True, slots=True)
class Mark:
    """The operator's note: something is here."""

    stamp_ns: int
    receive_ns: int
    text: str


Recordable: TypeAlias = Message | Diagnostics | Mark
"""Everything that can be offered to a recording."""
