"""How a receiver errs under canopy: the model's numbers, and the events that befall it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class GnssErrorModel:
    """Every error can be switched off by its number. Rates are a minute, 0: never."""

    seed: int = 1
    sigma_fixed_m: tuple[float, float] = (0.012, 0.02)
    """Horizontal and vertical one-sigma of RTK fixed, of each of the other qualities likewise, under open sky."""
    sigma_float_m: tuple[float, float] = (0.25, 0.4)
    sigma_single_m: tuple[float, float] = (1.5, 2.5)
    canopy_growth: float = 1.0
    """Sigmas grow by this factor more under closed canopy: multipath."""
    correlation_s: float = 20.0
    """Time constant of the Gauss-Markov errors."""
    white_share: float = 0.2
    """Share of sigma that is white from epoch to epoch."""
    reported_scale: float = 1.0
    """Reported over true sigma: 1 is honest, 0.2 claims five times too much."""
    signal_sigma: float = 0.1
    """Fluctuation of the signal (1 - canopy) that drives the quality, correlated over `signal_s`."""
    signal_s: float = 6.0
    fixed_above: float = 0.36
    float_above: float = 0.12
    time_to_fix_s: float = 3.0
    """How long the signal must be good before float becomes fixed."""
    dropouts_per_min: float = 0.0
    dropout_s: tuple[float, float] = (15.0, 30.0)
    spikes_per_min: float = 0.0
    spike_m: float = 10.0
    spike_s: float = 0.2
    offsets_per_min: float = 0.0
    offset_m: float = 10.0
    offset_s: float = 10.0
    quiet_start_s: float = 10.0
    """No event before this: the carrier stands in the open at first."""


CLEAN = GnssErrorModel(canopy_growth=0.0, float_above=-math.inf, fixed_above=-math.inf, time_to_fix_s=0.0)
"""RTK fixed throughout: open sky."""
HONEST = GnssErrorModel(dropouts_per_min=0.2)
"""Canopy, with sigmas that tell the truth."""
DISHONEST = GnssErrorModel(dropouts_per_min=0.2, reported_scale=0.2)
"""The same, with sigmas five times too small."""
CORRUPTED = GnssErrorModel(dropouts_per_min=0.4, spikes_per_min=3.0, offsets_per_min=0.8, reported_scale=0.5)
"""Dropouts, spikes of 10 m and offsets of 10 m for 10 s that no sigma tells of."""

PRESETS: dict[str, GnssErrorModel] = {
    "clean": CLEAN,
    "honest": HONEST,
    "dishonest": DISHONEST,
    "corrupted": CORRUPTED,
}


@dataclass(frozen=True, slots=True)
class Event:
    """Something that lasts from start_s to end_s; `enu_m` is the error it adds."""

    start_s: float
    end_s: float
    enu_m: npt.NDArray[np.float64]


class Timeline:
    """Random events of one kind, the same whoever asks when; times in seconds."""

    def __init__(self, events: Iterator[Event]) -> None:
        self._events = events
        self._known: list[Event] = []

    def at(self, t_s: float) -> Event | None:
        """The event that holds at a time."""
        while not self._known or self._known[-1].start_s <= t_s:
            event = next(self._events, None)
            if event is None:
                break
            self._known.append(event)
        return next((event for event in reversed(self._known) if event.start_s <= t_s < event.end_s), None)


def dropouts(model: GnssErrorModel) -> Timeline:
    return Timeline(_events(model, 1, model.dropouts_per_min, model.dropout_s, size_m=0.0, spread=0.0))


def spikes(model: GnssErrorModel) -> Timeline:
    lasting_s = (model.spike_s, model.spike_s)
    return Timeline(_events(model, 2, model.spikes_per_min, lasting_s, size_m=model.spike_m, spread=0.15))


def offsets(model: GnssErrorModel) -> Timeline:
    lasting_s = (model.offset_s, model.offset_s)
    return Timeline(_events(model, 3, model.offsets_per_min, lasting_s, size_m=model.offset_m, spread=0.1))


def _events(
    model: GnssErrorModel, stream: int, per_min: float, lasting_s: tuple[float, float], *, size_m: float, spread: float
) -> Iterator[Event]:
    """A Poisson process whose events do not overlap; each points in a random, mostly horizontal direction."""
    if per_min <= 0.0:
        return
    random = np.random.default_rng((model.seed, stream))
    start_s = model.quiet_start_s
    while True:
        start_s += random.exponential(60.0 / per_min)
        end_s = start_s + random.uniform(*lasting_s)
        heading = random.uniform(0.0, 2.0 * math.pi)
        direction = np.array([math.cos(heading), math.sin(heading), random.normal(0.0, 0.5)])
        size = size_m * max(1.0 + spread * random.normal(), 0.0)
        yield Event(start_s, end_s, direction / np.linalg.norm(direction) * size)
        start_s = end_s
