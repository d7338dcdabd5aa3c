"""Losses that the recorder and the drivers counted themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from edge.validation.report import Finding, Level
from edge.validation.told import Told

_SENSOR = "sensor/"
_LOST, _RECEIVED = ".lost", ".received"
_WARN_SHARE, _FAIL_SHARE = 0.005, 0.1
"""Losses on the way from a sensor: odometry bears a few packets, not every tenth."""
_DROP_FAIL_SHARE = 0.05


def dropped(said: Told | None) -> dict[str, int]:
    """Messages by topic that the recorder's queue had no room for."""
    return {topic: drops.count for topic, drops in (said.dropped if said else {}).items() if drops.count}


def lost(said: Told | None) -> dict[str, tuple[int, int]]:
    """(lost, received) by "sensor stream" from the last diagnostics, since the driver started; where any were lost."""
    found: dict[str, tuple[int, int]] = {}
    for part, note in (said.diagnostics if said else {}).items():
        for key, value in note.values.items():
            if not part.startswith(_SENSOR) or not key.endswith(_LOST) or not value.isdecimal():
                continue
            stream = key.removesuffix(_LOST)
            received = note.values.get(stream + _RECEIVED, "")
            if int(value):
                name = f"{part.removeprefix(_SENSOR)} {stream}"
                found[name] = (int(value), int(received) if received.isdecimal() else 0)
    return found


def check_dropped(drops: Mapping[str, int], counts: Mapping[str, int]) -> Iterator[Finding]:
    """A drop means that the card was too slow."""
    for topic, count in drops.items():
        share = count / (count + counts.get(topic, 0))
        level = Level.FAIL if share > _DROP_FAIL_SHARE else Level.WARN
        text = f"The recorder had to leave out {count:,} messages of {topic} ({share:.1%})."
        yield Finding(level, topic, text, "The card was too slow; use a faster one, or format this one.")


def check_lost(losses: Mapping[str, tuple[int, int]]) -> Iterator[Finding]:
    """What got lost between a sensor and the computer, as its driver counted it."""
    for name, (count, received) in losses.items():
        share = count / (count + received)
        level = Level.FAIL if share > _FAIL_SHARE else Level.WARN if share > _WARN_SHARE else Level.NOTE
        text = f"Between the sensor and the computer {share:.1%} were lost ({name}: {count:,})."
        yield Finding(level, "", text, "Check the cable, or the distance of the radio link.")
