"""Quantities as the operator reads them: short, aligned, with their unit."""

from __future__ import annotations

from datetime import datetime, timezone

NOTHING = "-"
"""Shown where a quantity is not known."""
_PREFIXES = (("k", 1e3), ("M", 1e6), ("G", 1e9), ("T", 1e12))


def elapsed(seconds: float) -> str:
    """Time since the start, as on a stop watch: `0:12:34`."""
    whole = max(0, int(seconds))
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def remaining(seconds: float | None) -> str:
    """Time left, coarse on purpose: `2h 10m`, `8m`, `45s`; `> 99h` for a nearly empty card."""
    if seconds is None:
        return NOTHING
    whole = max(0, int(seconds))
    if whole < 60:
        return f"{whole}s"
    if whole < 3600:
        return f"{whole // 60}m"
    if whole < 100 * 3600:
        return f"{whole // 3600}h {whole // 60 % 60:02d}m"
    return "> 99h"


def age(seconds: float) -> str:
    """How old something is: `0.4 s`, `12 s`, `3 min`, `2 h`."""
    if seconds < 1:
        return f"{max(0.0, seconds):.1f} s"
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h"


def size(count: int) -> str:
    """Bytes in powers of 1000 with three digits: `1.23 GB`."""
    if count < 1000:
        return f"{count} B"
    value = float(count)
    for unit in ("kB", "MB", "GB", "TB"):
        value /= 1000
        if value < 999.5 or unit == "TB":
            break
    digits = 2 if value < 9.995 else 1 if value < 99.95 else 0
    return f"{value:.{digits}f} {unit}"


def hertz(rate_hz: float) -> str:
    """A rate without its unit: one decimal up to 100, none above."""
    return f"{rate_hz:.1f}" if rate_hz < 99.95 else f"{rate_hz:.0f}"


def nominal_hertz(rate_hz: float) -> str:
    """An expected rate without its unit, as short as it is exact: `10`, `29.97`."""
    return f"{rate_hz:.2f}".rstrip("0").rstrip(".")


def count(number: int) -> str:
    """A counter in at most five characters: `0`, `9999`, `12.3k`, `4.5M`."""
    if number < 10_000:
        return str(number)
    prefix, scale = next((entry for entry in _PREFIXES if number < 999.5 * entry[1]), _PREFIXES[-1])
    return f"{number / scale:.{1 if number < 99.95 * scale else 0}f}{prefix}"


def seconds(duration_s: float) -> str:
    """A gap: `0.01s`, `4.2s`, `35s`."""
    if duration_s < 0.995:
        return f"{duration_s:.2f}s"
    return f"{duration_s:.1f}s" if duration_s < 9.95 else f"{duration_s:.0f}s"


def metres(sigma_m: float) -> str:
    """A one-sigma in metres: `0.02 m`, `1.4 m`, `12 m`; `-` for NaN or infinity."""
    if not 0 <= sigma_m < 1e6:
        return NOTHING
    digits = 2 if sigma_m < 0.995 else 1 if sigma_m < 9.95 else 0
    return f"{sigma_m:.{digits}f} m"


def millis(sigma_ms: float) -> str:
    """A clock's one-sigma: `0.31ms`, `2.1ms`, `48ms`, `1.2s`; `-` when it has none yet."""
    if not 0 <= sigma_ms < 1e7:
        return NOTHING
    if sigma_ms >= 999.5:
        return f"{sigma_ms / 1000:.1f}s"
    digits = 2 if sigma_ms < 0.995 else 1 if sigma_ms < 9.95 else 0
    return f"{sigma_ms:.{digits}f}ms"


def percent(value: float) -> str:
    return f"{value:.0f} %"


def celsius(temperature_c: float | None) -> str:
    return NOTHING if temperature_c is None else f"{temperature_c:.0f} °C"


def utc(stamp_ns: int) -> str:
    """The recorder's clock: `14:03:22 UTC`."""
    return datetime.fromtimestamp(stamp_ns // 1_000_000_000, timezone.utc).strftime("%H:%M:%S UTC")
