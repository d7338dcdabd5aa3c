"""What is wrong with the files themselves, and how the recording ended."""

from __future__ import annotations

from collections.abc import Iterator

from edge.validation.recording import Recording
from edge.validation.report import Finding, Level
from edge.validation.sample import Sample


def check(recording: Recording, sample: Sample) -> Iterator[Finding]:
    """Open, damaged, missing and contradicting files."""
    advice = f"Run `mapforest recover {recording.name}`; it writes a sound copy and says what was lost."
    for name, why in recording.unreadable.items():
        yield Finding(Level.FAIL, "", f"{name} cannot be read: {why}.")
    for index in recording.files:
        if not index.finished:
            text = f"{index.path.name} was not closed: it is still being recorded, or the power was cut."
            yield Finding(Level.WARN, "", text, advice)
        for damage in index.damages:
            level = Level.WARN if "cut off" in damage else Level.FAIL
            yield Finding(level, "", f"{index.path.name} is damaged: {damage}.", advice)
    for damage in sample.damages:
        yield Finding(Level.FAIL, "", f"The recording is damaged: {damage}.", advice)
    for number in recording.missing_splits:
        text = f"Part {number} of the recording is missing."
        yield Finding(Level.FAIL, "", text, "Copy the whole session folder from the card again.")
    for name in recording.conflicts:
        yield Finding(Level.FAIL, name, f"{name} has different types in different files.")
    yield from _ending(recording)


def _ending(recording: Recording) -> Iterator[Finding]:
    """A recording of ours says at its end why it ended; one that does not was cut off, and repaired since."""
    said, closed = recording.said, all(index.finished for index in recording.files)
    if recording.facts is None or not closed:
        return
    if said is None or not said.last:
        text = "The recording was not stopped but cut off (power?); about the last second is missing."
        yield Finding(Level.WARN, "", text, "The file was repaired. Check the battery and its plug.")
    elif said.ended.startswith("disk"):
        text = f"The recorder ended the recording by itself: {said.ended}."
        yield Finding(Level.WARN, "", text, "Make room on the card, or use another one.")
