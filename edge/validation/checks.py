"""One small function a check: the facts of a topic in, findings in plain words out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from edge.validation.expected import Expected
from edge.validation.index import Topic
from edge.validation.rates import Rates, Span
from edge.validation.report import Finding, Level

_TAIL_WARN_S, _TAIL_FAIL_S = 1.0, 3.0
_START_WARN_S = 3.0
_MISSING_FAIL_SHARE = 0.05
"""Of the session in gaps (leggedrobotics' health check fails there too)."""
_LATENCY_WARN_S = 2.0


@dataclass(frozen=True, slots=True)
class Facts:
    """One expected topic. stamps_ns: runs of consecutive stamps of the sample. latencies_s: reception minus stamp."""

    name: str
    expected: Expected
    topic: Topic | None
    rates: Rates | None
    span: Span
    stamps_ns: tuple[npt.NDArray[np.int64], ...] = ()
    latencies_s: npt.NDArray[np.float64] | None = None

    @property
    def serious(self) -> Level:
        """What a defect of this topic amounts to."""
        return Level.FAIL if self.expected.required else Level.WARN

    def finding(self, level: Level, text: str, advice: str | None = None) -> Finding:
        return Finding(level, self.name, text, self.expected.advice if advice is None else advice)


def _cap(text: str) -> str:
    return text[:1].upper() + text[1:]


def presence(facts: Facts) -> Iterator[Finding]:
    """Something must have come at all."""
    if facts.rates is None:
        yield facts.finding(facts.serious, f"Nothing was recorded from {facts.expected.what} ({facts.name}).")


def kind(facts: Facts) -> Iterator[Finding]:
    """The type must be one that the programs behind can read."""
    wanted = facts.expected.types
    if facts.topic is not None and wanted and not facts.topic.type_name.endswith(wanted):
        names = " or ".join(name.lstrip("/") for name in wanted)
        text = f"{facts.name} holds {facts.topic.type_name or 'messages without a type'}, where {names} is expected."
        yield facts.finding(facts.serious, text, "Set the topic names in the configuration.")


def rate(facts: Facts) -> Iterator[Finding]:
    """The mean rate between first and last message."""
    rates, expected = facts.rates, facts.expected
    if rates is None or rates.count < 3 or expected.nominal_hz <= 0:
        return
    said = (
        f"{_cap(expected.what)} delivered {_hz(rates.rate_hz)} messages a second instead of {_hz(expected.nominal_hz)}"
    )
    if rates.rate_hz < expected.min_hz:
        yield facts.finding(facts.serious, f"{said} ({facts.name}).")
    elif rates.rate_hz > expected.max_hz:
        advice = "Messages may be recorded twice; check that only one such sensor is connected."
        yield facts.finding(Level.WARN, f"{said} ({facts.name}).", advice)


def tail(facts: Facts) -> Iterator[Finding]:
    """A mean rate hides a sensor that died: the last message must be near the end."""
    if facts.rates is None or facts.expected.nominal_hz <= 0:
        return
    silent_s, allowed_s = facts.rates.ends_before_s, facts.expected.max_gap_s
    if silent_s > max(_TAIL_WARN_S, allowed_s):
        level = facts.serious if silent_s > max(_TAIL_FAIL_S, 2 * allowed_s) else Level.WARN
        text = f"{_cap(facts.expected.what)} stopped {silent_s:.1f} s before the end of the recording ({facts.name})."
        yield facts.finding(level, text)


def start(facts: Facts) -> Iterator[Finding]:
    """A sensor that comes late costs the beginning."""
    if facts.rates is None or facts.expected.nominal_hz <= 0:
        return
    late_s = facts.rates.starts_s
    if late_s > max(_START_WARN_S, facts.expected.max_gap_s):
        level = facts.serious if late_s > 0.5 * facts.span.duration_s else Level.WARN
        text = f"{_cap(facts.expected.what)} began only {late_s:.1f} s after the start ({facts.name})."
        yield facts.finding(level, text, "Start to record when every sensor shows ok.")


def gaps(facts: Facts) -> Iterator[Finding]:
    """Silences longer than allowed, and how much they add up to."""
    rates, expected = facts.rates, facts.expected
    if rates is None or rates.largest_gap_s <= expected.max_gap_s:
        return
    count, missing_s = rates.gaps(expected.max_gap_s), rates.missing_s(expected.max_gap_s)
    too_much = missing_s > _MISSING_FAIL_SHARE * facts.span.duration_s
    level = facts.serious if rates.largest_gap_s > expected.fail_gap_s or too_much else Level.WARN
    text = f"{_cap(expected.what)} was silent for {rates.largest_gap_s:.2f} s at second {rates.gap_at_s:.1f}"
    text += f", the longest of {count} gaps ({missing_s:.1f} s in all)" if count > 1 else ""
    yield facts.finding(min(level, facts.serious), f"{text} ({facts.name}).")


def reception_order(facts: Facts) -> Iterator[Finding]:
    """Log times are the recorder's own clock: they never go back in a sound file."""
    if facts.rates is not None and facts.rates.backwards:
        text = f"The recording time of {facts.name} goes backwards {facts.rates.backwards} times."
        yield facts.finding(Level.WARN, text, "The computer's clock was set during the recording.")


def stamp_order(facts: Facts) -> Iterator[Finding]:
    """Measurement stamps must grow: odometry cannot use a sensor whose time jumps back."""
    if facts.expected.nominal_hz <= 0:  # the sentences of one epoch share a time
        return
    steps = [np.diff(stamps) for stamps in facts.stamps_ns]
    back = sum(int(np.count_nonzero(step < 0)) for step in steps)
    same = sum(int(np.count_nonzero(step == 0)) for step in steps)
    if back:
        worst_s = -min(float(step.min()) for step in steps if step.size) / 1e9
        level = facts.serious if facts.expected.orders_motion else Level.WARN
        text = f"The measurement times of {facts.expected.what} go backwards {back} times, by up to {worst_s:.3f} s"
        advice = "Its clock was reset; the trajectory cannot be computed across that place."
        yield facts.finding(level, f"{text} (in a sample of {facts.name}).", advice)
    if same:
        text = f"{same} measurements of {facts.expected.what} have the same time as the one before"
        advice = "Messages may be recorded twice."
        yield facts.finding(Level.WARN, f"{text} (in a sample of {facts.name}).", advice)


def stamp_regularity(facts: Facts) -> Iterator[Finding]:
    """Intervals of the sensor's own clock: more than 1.5 periods means that measurements are missing."""
    steps = np.concatenate([np.diff(stamps) for stamps in facts.stamps_ns] or [np.empty(0, np.int64)])
    if steps.size < 20 or facts.expected.nominal_hz <= 0:
        return
    period_ns = float(np.median(steps))
    share = float(np.mean(steps > 1.5 * period_ns)) if period_ns > 0 else 0.0
    if share > 0.01:
        level = facts.serious if share > _MISSING_FAIL_SHARE and facts.expected.orders_motion else Level.WARN
        text = f"{share:.0%} of the sampled measurements of {facts.expected.what} come after a missing one"
        yield facts.finding(level, f"{text} ({facts.name}).")


def latency(facts: Facts) -> Iterator[Finding]:
    """Reception minus measurement: large means that the sensor's clock was not brought to session time."""
    if facts.latencies_s is None or facts.latencies_s.size == 0:
        return
    typical_s = float(np.median(facts.latencies_s))
    if abs(typical_s) > _LATENCY_WARN_S:
        text = (
            f"The measurement times of {facts.expected.what} are {_apart(typical_s)} the recording time ({facts.name})."
        )
        yield facts.finding(Level.WARN, text, "Its clock was not synchronised; sensors may not fit together in time.")


def _apart(seconds: float) -> str:
    amount = abs(seconds)
    said = (
        f"{amount:.1f} s"
        if amount < 600
        else f"{amount / 3600:.1f} h"
        if amount < 172_800
        else f"{amount / 86_400:.0f} days"
    )
    return f"{said} {'behind' if seconds > 0 else 'ahead of'}"


def _hz(rate_hz: float) -> str:
    return f"{rate_hz:.3g}"


CHECKS: tuple[Callable[[Facts], Iterator[Finding]], ...] = (
    presence,
    kind,
    rate,
    tail,
    start,
    gaps,
    stamp_order,
    stamp_regularity,
    reception_order,
    latency,
)
