"""Losses that the recorder and the drivers counted themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from edge.validation.report import Finding, Level
from edge.validation.told import Note, Told

_SENSOR = "sensor/"
_LOST, _UNITS, _RECEIVED = ".lost", ".units", ".received"
_WARN_SHARE, _FAIL_SHARE = 0.005, 0.1
"""Losses on the way from a sensor: odometry bears a few packets, not every tenth."""
_DROP_FAIL_SHARE = 0.05


def dropped(said: Told | None) -> dict[str, int]:
    """Messages by topic that the recorder's queue had no room for."""
    return {topic: drops.count for topic, drops in (said.dropped if said else {}).items() if drops.count}


def lost(said: Told | None) -> dict[str, tuple[int, int]]:
    """(lost, received) by "sensor stream" during the session, by the diagnostics; where any were lost.

    Both in the unit losses are counted in: packets of a LiDAR, not its scans.
    """
    found: dict[str, tuple[int, int]] = {}
    for part, note in (said.diagnostics if said else {}).items():
        if said is None or not part.startswith(_SENSOR):
            continue
        before = _streams(said.first_diagnostics.get(part, Note()))
        for stream, (count, received) in _streams(note).items():
            count_before, received_before = before.get(stream, (0, 0))
            if received < received_before:  # the driver was started again meanwhile, and counts from zero
                count_before, received_before = 0, 0
            if count > count_before:
                name = f"{part.removeprefix(_SENSOR)} {stream}"
                found[name] = (count - count_before, received - received_before)
    return found


def _streams(note: Note) -> dict[str, tuple[int, int]]:
    """(lost, received) by stream since the driver started."""
    counts = {key: int(value) for key, value in note.values.items() if value.isdecimal()}
    names = [key.removesuffix(_LOST) for key in counts if key.endswith(_LOST)]
    return {name: (counts[name + _LOST], counts.get(name + _UNITS, counts.get(name + _RECEIVED, 0))) for name in names}


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
