"""The computer: load, memory, heat, throttling, battery, room on the card. Read from /proc and /sys."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class HostSample:
    """One look at the computer. None where it cannot tell."""

    cpu_percent: float
    memory_percent: float
    temperature_c: float | None
    throttled: bool
    throttled_by: str
    """Which cooling device or over-current guard slows the computer down."""
    battery_remaining_s: float | None


class HostProbe:
    """Samples `root`/proc and `root`/sys; CPU load and over-current counts are since the last sample."""

    def __init__(self, root: Path = Path("/")) -> None:
        self._proc = root / "proc"
        self._sys = root / "sys"
        self._cpu = self._cpu_times()
        self._over_current = self._over_current_events()

    def sample(self) -> HostSample:
        """Costs well under a millisecond."""
        throttled_by = ", ".join([*self._cooling(), *self._over_current_since()])
        return HostSample(
            cpu_percent=self._cpu_percent(),
            memory_percent=self._memory_percent(),
            temperature_c=max(self._temperatures(), default=None),
            throttled=bool(throttled_by),
            throttled_by=throttled_by,
            battery_remaining_s=self._battery_s(),
        )

    def _cpu_times(self) -> tuple[int, int]:
        """(busy, all) in ticks."""
        words = _text(self._proc / "stat").partition("\n")[0].split()[1:9]
        ticks = [int(word) for word in words]
        return (sum(ticks) - sum(ticks[3:5]), sum(ticks)) if len(ticks) >= 5 else (0, 0)

    def _cpu_percent(self) -> float:
        before, self._cpu = self._cpu, self._cpu_times()
        span = self._cpu[1] - before[1]
        return 100.0 * (self._cpu[0] - before[0]) / span if span > 0 else 0.0

    def _memory_percent(self) -> float:
        sizes = {}
        for line in _text(self._proc / "meminfo").splitlines():
            name, _, rest = line.partition(":")
            sizes[name] = _number(rest.split()[0] if rest.split() else "")
        total, available = sizes.get("MemTotal"), sizes.get("MemAvailable")
        return 100.0 * (1.0 - available / total) if total and available is not None else 0.0

    def _temperatures(self) -> Iterator[float]:
        for zone in self._sys.glob("class/thermal/thermal_zone*"):
            millidegrees = _number(_text(zone / "temp"))
            if millidegrees is not None and 0 < millidegrees < 150_000:  # unpowered zones report nonsense
                yield millidegrees / 1000.0

    def _cooling(self) -> Iterator[str]:
        """Cooling devices at work that cost speed: every kind but fans."""
        for device in sorted(self._sys.glob("class/thermal/cooling_device*")):
            kind = _text(device / "type").strip()
            if "fan" not in kind.lower() and (_number(_text(device / "cur_state")) or 0) > 0:
                yield kind or device.name

    def _over_current_events(self) -> dict[Path, float]:
        """Counters of the Jetson's over-current guards."""
        found = {path: _number(_text(path)) for path in self._sys.glob("class/hwmon/hwmon*/oc*_event_cnt")}
        return {path: count for path, count in found.items() if count is not None}

    def _over_current_since(self) -> Iterator[str]:
        before, self._over_current = self._over_current, self._over_current_events()
        for path, count in self._over_current.items():
            if count > before.get(path, count):
                yield f"over-current ({path.name.removesuffix('_event_cnt')})"

    def _battery_s(self) -> float | None:
        for supply in sorted(self._sys.glob("class/power_supply/*")):
            if _text(supply / "type").strip() == "Battery" and _text(supply / "status").strip() == "Discharging":
                for stored, drawn in (("energy_now", "power_now"), ("charge_now", "current_now")):
                    left, rate = _number(_text(supply / stored)), _number(_text(supply / drawn))
                    if left is not None and rate:
                        return 3600.0 * left / abs(rate)
        return None


def _text(path: Path) -> str:
    """Empty when the file is not there or cannot be read just now (a thermal zone that is off answers EAGAIN)."""
    with contextlib.suppress(OSError, UnicodeDecodeError):
        return path.read_text(encoding="ascii")
    return ""


def _number(text: str) -> float | None:
    with contextlib.suppress(ValueError):
        return float(text)
    return None
