"""How well the clocks of a recording are known."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from edge.validation.report import Finding, Level
from edge.validation.told import Told

_SIGMA = re.compile(r"sigma.*?(ms|us|ns)?$", re.IGNORECASE)
_TO_MS = {"ns": 1e-6, "us": 1e-3, "ms": 1.0}
_DRIFT_NOTE_MS = 100.0


def sigmas_ms(said: Told | None) -> dict[str, float]:
    """By part, from its last diagnostics: the value called clock sigma."""
    found: dict[str, float] = {}
    for part, note in (said.diagnostics if said else {}).items():
        for key, value in note.values.items():
            unit = _SIGMA.search(key)
            number = re.match(r"\s*([0-9.]+(?:e-?\d+)?)", value)
            if unit and number and "clock" in key.lower():
                found[part] = float(number[1]) * _TO_MS[(unit[1] or "ms").lower()]
    return found


def check(said: Told | None, sigmas: Mapping[str, float], max_sigma_ms: float) -> Iterator[Finding]:
    """Sensor clocks against the limit; the host's own clock for information."""
    for part, sigma_ms in sigmas.items():
        if sigma_ms > max_sigma_ms:
            text = f"The clock of {part} is known only to {sigma_ms:.1f} ms (limit {max_sigma_ms:g} ms)."
            yield Finding(Level.WARN, "", text, "Positions may be smeared; check that sensor's link.")
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
