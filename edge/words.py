"""Figures as people read them."""

from __future__ import annotations

from datetime import datetime, timezone


def size(octets: int) -> str:
    """Bytes, in the unit that leaves one to four digits."""
    amount = float(octets)
    for unit in ("B", "kB", "MB"):
        if amount < 1000:
            return f"{amount:.0f} {unit}" if unit == "B" else f"{amount:.1f} {unit}"
        amount /= 1000
    return f"{amount:.2f} GB"


def duration(seconds: float) -> str:
    """1.5 s, 2 min 05 s, 1 h 02 min."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def date(utc_ns: int) -> str:
    """UTC to the second."""
    return f"{datetime.fromtimestamp(utc_ns // 1_000_000_000, timezone.utc):%Y-%m-%d %H:%M:%S} UTC"
