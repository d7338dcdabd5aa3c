"""A rate's recent past in one row of characters."""

from __future__ import annotations

from collections.abc import Sequence

BARS = "▁▂▃▄▅▆▇"
"""The full block is left out: a bar at the top edge would touch the row above."""


def sparkline(ratios: Sequence[float], width: int) -> str:
    """The last `width` ratios of measured to expected, right-aligned, one bar each.

    1 is half up, so that too much shows as well as too little; nothing received is the base line.
    """
    shown = ratios[-width:] if width > 0 else ()
    return "".join(_bar(ratio) for ratio in shown).rjust(max(width, 0))


def _bar(ratio: float) -> str:
    if not ratio > 0:
        return BARS[0]
    return BARS[max(1, round(min(ratio, 1.5) * 4))]
