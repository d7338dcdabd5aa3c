"""One line of the preflight list."""

from __future__ import annotations

from enum import Enum

import msgspec


class Outcome(Enum):
    """How a check ended."""

    GOOD = "good"
    WARNING = "warning"
    BAD = "bad"


class Check(msgspec.Struct, frozen=True):
    """What was looked at, what was found, and, unless it is good, what to do."""

    subject: str
    outcome: Outcome
    found: str
    advice: str = ""
