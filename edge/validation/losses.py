"""Losses that the recorder and the drivers counted themselves."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from edge.validation.report import Finding, Level
from edge.validation.told import Told

_LOST = re.compile(r"(?:^|[ _./])(lost|dropped)(?:$|[ _./])", re.IGNORECASE)
_FAIL_SHARE, _WARN_SHARE = 0.05, 0.005


def dropped(said: Told | None) -> dict[str, int]:
    """Messages by topic that the recorder's queue had no room for."""
    return {topic: drops.count for topic, drops in (said.dropped if said else {}).items() if drops.count}


def lost(said: Told | None) -> dict[str, int]:
    """By "sensor: stream", from the last diagnostics: every value whose name says "lost"."""
    found: dict[str, int] = {}
    for part, note in (said.diagnostics if said else {}).items():
        for key, value in note.values.items():
            count = re.match(r"\s*(\d+)", value)
            if count and int(count[1]) and _LOST.search(key):
                found[f"{part}: {key}"] = int(count[1])
    return found


def check_dropped(drops: Mapping[str, int], counts: Mapping[str, int]) -> Iterator[Finding]:
    """A drop means that the card was too slow."""
    for topic, count in drops.items():
        share = count / (count + counts.get(topic, 0))
        text = f"The recorder had to leave out {count:,} messages of {topic} ({share:.1%})."
        yield Finding(_level(share), topic, text, "The card was too slow; use a faster one, or format this one.")


def check_lost(said: Told | None) -> Iterator[Finding]:
    """What got lost between a sensor and the computer, against what arrived where that was told."""
    for name, count in lost(said).items():
        part, key = name.split(": ", 1)
        values = said.diagnostics[part].values if said else {}
        received = re.match(r"\s*(\d+)", values.get(_LOST.sub(lambda m: m[0].replace(m[1], "received"), key), ""))
        share = count / (count + int(received[1])) if received else 0.0
        told = f" ({share:.1%})" if received else ""
        level = _level(share) if not received or share > _WARN_SHARE else Level.NOTE
        text = f"Between {part} and the recorder {count:,} were lost{told}: {key}."
        yield Finding(level, "", text, "Check the cable, or the distance of the radio link.")


def _level(share: float) -> Level:
    return Level.FAIL if share > _FAIL_SHARE else Level.WARN
