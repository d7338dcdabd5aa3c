"""Faults on demand, written `sensor:kind[=value][@start_s[+duration_s]]`.

    livox:loss=0.05            5 % of the packets are lost, from start to end
    livox:reboot@20            the LiDAR reboots 20 s after the payload came up
    reach:stall@30+7           the receiver is silent for 7 s
    gopro:clock_step=2.5@15    the camera's clock jumps by 2.5 s

Kinds and the unit of their value: see `KINDS`. Times count from the moment the payload is up.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from drivers.errors import SimulationError

KINDS: dict[str, str] = {
    "loss": "share of packets or sentences lost, 0..1",
    "duplicate": "share sent twice, 0..1",
    "reorder": "share sent one packet late, 0..1",
    "garbage": "random datagrams or bytes a second",
    "corrupt": "share with flipped bits, 0..1",
    "delay_jitter": "mean of an exponential extra delay, s",
    "clock_drift": "parts per million",
    "clock_step": "s",
    "reboot": "no value",
    "stall": "no value: silent, the link stays",
    "disconnect": "no value: the link goes away",
}
SENSORS = ("livox", "reach", "gopro")
_GRAMMAR = re.compile(
    r"(?P<sensor>[a-z0-9]+):(?P<kind>[a-z_]+)(=(?P<value>-?[0-9.]+))?(@(?P<start>[0-9.]+)(\+(?P<duration>[0-9.]+))?)?"
)


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of one sensor, active in [start_s, start_s + duration_s)."""

    sensor: str
    kind: str
    value: float = 0.0
    start_s: float = 0.0
    duration_s: float = math.inf


def parse(text: str) -> Fault:
    """One fault from its written form. SimulationError says what is wrong with it."""
    match = _GRAMMAR.fullmatch(text)
    if match is None:
        raise SimulationError(f"fault {text!r}: expected sensor:kind[=value][@start_s[+duration_s]]")
    if match["sensor"] not in SENSORS:
        raise SimulationError(f"fault {text!r}: unknown sensor {match['sensor']!r}, one of {', '.join(SENSORS)}")
    if match["kind"] not in KINDS:
        raise SimulationError(f"fault {text!r}: unknown kind {match['kind']!r}, one of {', '.join(KINDS)}")
    return Fault(
        match["sensor"],
        match["kind"],
        float(match["value"] or 0.0),
        float(match["start"] or 0.0),
        float(match["duration"]) if match["duration"] else math.inf,
    )


class FaultPlan:
    """The faults of one sensor, asked by an emulator as time goes on."""

    def __init__(self, sensor: str, faults: Iterable[Fault]) -> None:
        self._faults = tuple(fault for fault in faults if fault.sensor == sensor)
        self._fired: set[Fault] = set()

    def level(self, kind: str, t_s: float) -> float:
        """Sum of the values of the active faults of a kind, 0.0 when none is."""
        return sum(fault.value for fault in self._active(kind, t_s))

    def active(self, kind: str, t_s: float) -> bool:
        """Whether a lasting fault (stall, disconnect) holds now."""
        return any(True for _ in self._active(kind, t_s))

    def due(self, kind: str, t_s: float) -> list[Fault]:
        """Momentary faults (reboot, clock_step) whose time has come, each once."""
        due = [fault for fault in self._active(kind, t_s) if fault not in self._fired]
        self._fired.update(due)
        return due

    def _active(self, kind: str, t_s: float) -> Iterable[Fault]:
        return (f for f in self._faults if f.kind == kind and f.start_s <= t_s < f.start_s + f.duration_s)
