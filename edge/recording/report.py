"""What a repair kept and what it had to give up, in figures and in words."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

Name = Callable[[int], str]


class Damage(msgspec.Struct, frozen=True):
    """One damaged place. messages: per topic, as far as surviving indexes tell. Log times, None if unknown."""

    offset: int
    size: int
    reason: str
    messages: dict[str, int] = {}
    start_ns: int | None = None
    end_ns: int | None = None


class RecoverReport(msgspec.Struct, frozen=True):
    """The outcome of a repair. `target` equals `source` when the file was finished in place."""

    source: str
    target: str
    complete: bool
    """The file had been closed properly; nothing had to be rebuilt."""
    topics: dict[str, int]
    """Messages kept."""
    chunks: int
    bytes_dropped: int
    """Bytes of records that could not be kept. A torn closing part does not count: it was rebuilt."""
    first_ns: int | None
    last_ns: int | None
    lost_tail_s: float | None
    """From the last message kept to the last one that is known to have been there; None when nothing tells."""
    damages: tuple[Damage, ...] = ()
    lost_messages: dict[str, int] = {}
    """Messages known to be gone, per topic. What was torn off at the end left no count behind."""

    @property
    def messages(self) -> int:
        return sum(self.topics.values())

    @property
    def lossless(self) -> bool:
        """Every message that reached the file is still there."""
        return not self.damages and not self.lost_messages

    def words(self) -> tuple[str, ...]:
        """For people, most important first."""
        return (_headline(self), *_losses(self), *(_place(damage, self.first_ns) for damage in self.damages))


def _headline(report: RecoverReport) -> str:
    kept = f"{report.messages:,} messages on {len(report.topics)} topics in {report.chunks:,} chunks"
    if report.lossless and report.complete:
        return f"The recording was whole: {kept}. Nothing was lost."
    if report.lossless:
        return f"The recording had not been closed; it is now: {kept}. Nothing that had reached the file was lost."
    return f"Kept {kept}; {report.bytes_dropped:,} bytes were damaged and could not be kept."


def _losses(report: RecoverReport) -> list[str]:
    said: list[str] = []
    if report.lost_messages:
        told = ", ".join(f"{count:,} on {topic}" for topic, count in sorted(report.lost_messages.items()))
        said.append(f"Known to be lost: {told}.")
    if report.lost_tail_s:
        said.append(f"At the end {report.lost_tail_s:.2f} s are missing.")
    elif report.lost_tail_s is None and report.damages and not report.complete:
        said.append("How much is missing at the end cannot be told; with a flush every second it is about one second.")
    return said


def _place(damage: Damage, first_ns: int | None) -> str:
    when = ""
    if damage.start_ns is not None and damage.end_ns is not None and first_ns is not None:
        when = f", from second {(damage.start_ns - first_ns) / 1e9:.2f} to {(damage.end_ns - first_ns) / 1e9:.2f}"
    held = ", ".join(f"{count:,} on {topic}" for topic, count in sorted(damage.messages.items()))
    size = f"{damage.size:,} bytes " if damage.size else ""
    return f"At byte {damage.offset:,}: {size}{damage.reason}{when}" + (f": {held}." if held else ".")
