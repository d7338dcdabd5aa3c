"""How well the clocks of a recording are known."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from edge.validation.report import Finding, Level
from edge.validation.told import Told

_SENSOR = "sensor/"
_SIGMA = "clock.sigma_ns"
_STEPS = "clock.steps"
_DRIFT_NOTE_MS = 100.0


def sigmas_ms(said: Told | None) -> dict[str, float]:
    """One-sigma of each sensor's clock at the end, in ms, from the last diagnostics."""
    found: dict[str, float] = {}
    for part, note in (said.diagnostics if said else {}).items():
        sigma_ms = _number(note.values.get(_SIGMA, "")) / 1e6
        if part.startswith(_SENSOR) and math.isfinite(sigma_ms):
            found[part.removeprefix(_SENSOR)] = sigma_ms
    return found


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def check(said: Told | None, max_sigma_ms: float) -> Iterator[Finding]:
    """Sensor clocks against the limit; the host's own clock for information."""
    yield from _uncertain(sigmas_ms(said), max_sigma_ms)
    for part, note in (said.diagnostics if said else {}).items():
        if part.startswith(_SENSOR) and _number(note.values.get(_STEPS, "")) > 0:
            text = f"The clock of {part.removeprefix(_SENSOR)} jumped or restarted {note.values[_STEPS]} times."
            yield Finding(Level.NOTE, "", text)
    if said is None or said.clock is None:
        return
    if not said.clock.synchronised_at_start:
        text = "The computer's clock was not set when recording began; times of day may be wrong, nothing else is."
        yield Finding(Level.NOTE, "", text)
    if abs(said.clock.drift_ms) > _DRIFT_NOTE_MS:
        text = (
            f"The computer's clock was corrected by {said.clock.drift_ms / 1e3:.2f} s meanwhile; the recording is not."
        )
        yield Finding(Level.NOTE, "", text)


def _uncertain(sigmas: Mapping[str, float], max_sigma_ms: float) -> Iterator[Finding]:
    for name, sigma_ms in sigmas.items():
        if sigma_ms > max_sigma_ms:
            text = f"The clock of {name} is known only to {sigma_ms:.1f} ms (limit {max_sigma_ms:g} ms)."
            yield Finding(Level.WARN, "", text, "Positions may be smeared; check that sensor's link.")
