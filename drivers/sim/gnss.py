"""The receiver's position solution under canopy: a `GnssSource` over the true motion of the antenna."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from drivers.sim.gnss_errors import GnssErrorModel, dropouts, offsets, spikes
from drivers.sim.gnss_geodesy import Datum
from drivers.sim.sources import GnssEpoch

STEP_NS = 100_000_000
"""Grid of the random processes: they depend on the seed and the truth alone, never on who asks when."""
FIXED, FLOAT, SINGLE = 4, 5, 1
_CHANNELS = 8
"""Unit Gauss-Markov processes: error east, north, up; signal; velocity east, north; reported sigma; spare."""


class AntennaTruth(Protocol):
    """What is true of the antenna, in the local east, north, up frame."""

    def position(self, t_ns: int) -> npt.NDArray[np.float64]:
        """(3,) metres."""

    def velocity(self, t_ns: int) -> npt.NDArray[np.float64]:
        """(3,) m/s."""

    def canopy(self, t_ns: int) -> float:
        """0 open sky .. 1 closed."""


@dataclass(frozen=True, slots=True)
class _State:
    """The receiver at one grid time."""

    walk: npt.NDArray[np.float64]
    """(8,) unit Gauss-Markov processes."""
    white: npt.NDArray[np.float64]
    """(3,) unit white noise."""
    signal: float
    quality: int
    good_s: float
    """For how long the signal has been good enough for a fixed solution."""


class ReceiverModel:
    """Implements `drivers.sim.sources.GnssSource`. Times before 0 are taken as 0."""

    def __init__(self, truth: AntennaTruth, model: GnssErrorModel | None = None, datum: Datum | None = None) -> None:
        self.datum = datum or Datum()
        self._truth = truth
        self._model = model or GnssErrorModel()
        self._random = np.random.default_rng((self._model.seed, 0))
        self._dropouts, self._spikes, self._offsets = dropouts(self._model), spikes(self._model), offsets(self._model)
        self._states: list[_State] = []

    def epoch(self, t_ns: int) -> GnssEpoch | None:
        """The solution for an instant: no fix during a dropout."""
        t_ns = max(t_ns, 0)
        state = self._state(t_ns // STEP_NS)
        if self._dropouts.at(t_ns / 1e9) is not None:
            return self._no_fix(state)
        sigma_m = self._sigma_m(state, t_ns)
        position_m = self._truth.position(t_ns) + self._error_m(state, sigma_m, t_ns)
        latitude, longitude, height = self.datum.geodetic((position_m[0], position_m[1], position_m[2]))
        east, north = self._truth.velocity(t_ns)[:2] + 0.03 * state.walk[4:6]
        reported = sigma_m * self._model.reported_scale * math.exp(0.1 * state.walk[6])
        return GnssEpoch(
            latitude_deg=latitude,
            longitude_deg=longitude,
            height_m=height,
            geoid_separation_m=self.datum.geoid_separation_m,
            quality=state.quality,
            satellites=self._satellites(state),
            hdop=round(0.6 + 1.4 * max(1.0 - state.signal, 0.0), 1),
            age_s=None if state.quality == SINGLE else 1.0 + t_ns % 1_000_000_000 / 1e9,
            sigma_enu_m=(float(reported[0]), float(reported[1]), float(reported[2])),
            speed_m_s=math.hypot(east, north),
            course_deg=math.degrees(math.atan2(east, north)) % 360.0,
        )

    def error_m(self, t_ns: int) -> npt.NDArray[np.float64] | None:
        """(3,) true error of the solution at an instant, for evaluation; None during a dropout."""
        t_ns = max(t_ns, 0)
        if self._dropouts.at(t_ns / 1e9) is not None:
            return None
        state = self._state(t_ns // STEP_NS)
        return self._error_m(state, self._sigma_m(state, t_ns), t_ns)

    def _error_m(self, state: _State, sigma_m: npt.NDArray[np.float64], t_ns: int) -> npt.NDArray[np.float64]:
        white = self._model.white_share
        error_m = sigma_m * (math.sqrt(1.0 - white**2) * state.walk[:3] + white * state.white)
        for timeline in (self._spikes, self._offsets):
            event = timeline.at(t_ns / 1e9)
            if event is not None:
                error_m = error_m + event.enu_m
        return error_m

    def _sigma_m(self, state: _State, t_ns: int) -> npt.NDArray[np.float64]:
        """True one-sigma, east, north, up."""
        model = self._model
        table = {FIXED: model.sigma_fixed_m, FLOAT: model.sigma_float_m, SINGLE: model.sigma_single_m}
        horizontal, vertical = table[state.quality]
        growth = 1.0 + model.canopy_growth * self._truth.canopy(t_ns)
        return growth * np.array([horizontal, horizontal, vertical])

    def _satellites(self, state: _State) -> int:
        return int(min(max(round(6 + 20 * state.signal), 4), 28))

    def _no_fix(self, state: _State) -> GnssEpoch:
        nan = math.nan
        satellites = min(self._satellites(state), 3)
        separation_m = self.datum.geoid_separation_m
        return GnssEpoch(nan, nan, nan, separation_m, 0, satellites, nan, None, (nan, nan, nan), 0.0, 0.0)

    def _state(self, index: int) -> _State:
        while len(self._states) <= index:
            self._states.append(self._next_state(len(self._states)))
        return self._states[index]

    def _next_state(self, index: int) -> _State:
        model = self._model
        last = self._states[-1] if self._states else None
        kick = self._random.standard_normal(_CHANNELS)
        walk = kick if last is None else self._decay() * last.walk + np.sqrt(1.0 - self._decay() ** 2) * kick
        signal = 1.0 - self._truth.canopy(index * STEP_NS) + model.signal_sigma * float(walk[3])
        # Before the walk begins the receiver has stood in the open for long.
        before_s = math.inf if last is None else last.good_s
        good_s = before_s + STEP_NS / 1e9 if signal >= model.fixed_above else 0.0
        unfixed = FLOAT if signal >= model.float_above else SINGLE
        quality = FIXED if good_s > model.time_to_fix_s else unfixed
        return _State(walk, self._random.standard_normal(3), signal, quality, good_s)

    def _decay(self) -> npt.NDArray[np.float64]:
        constants_s = np.full(_CHANNELS, self._model.correlation_s)
        constants_s[3] = self._model.signal_s
        constants_s[4:6] = 1.0
        decay: npt.NDArray[np.float64] = np.exp(-STEP_NS / 1e9 / constants_s)
        return decay
