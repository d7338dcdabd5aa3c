"""Where a start stands in the filter's frame: at its origin at first, on the last pose after a break."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.odometry.filter import Filter
from pipeline.odometry.state import ERRORS, POSITION, VELOCITY, State

SHORTEST_S, FARTHEST_M, FASTEST_M_S, WALKED_M_S = 0.5, 1e3, 60.0, 1.0
YAW_RAD, YAW_RAD_S = 0.3, 0.5
LONGEST_S = 5.0
"""The way over a longer break is not guessed from the speeds before and after."""


class Footing:
    """state, stamp_ns: the last before the break; None at the first start. known_m: sigma of its place.

    lost_s: time that went by and does not show in the stamps.
    """

    def __init__(
        self, state: State | None = None, stamp_ns: int = 0, note: str = "", known_m: float = 0.0, lost_s: float = 0.0
    ) -> None:
        self._state = state
        self._stamp_ns = stamp_ns
        self._note = note
        self._known_m = known_m if np.isfinite(known_m) else FARTHEST_M
        self._lost_s = lost_s

    def say(self) -> str:
        """What to tell with the first estimate; once."""
        note, self._note = self._note, ""
        return note

    def doubt(self, stamp_ns: int) -> tuple[float, float]:
        """Sigmas of place (m) and yaw (rad) of a start at that stamp: what may have happened since the break."""
        if self._state is None:
            return 0.0, 0.0
        away_s = max(self._lost_s + (stamp_ns - self._stamp_ns) * 1e-9, SHORTEST_S)
        speed = float(np.linalg.norm(self._state.velocity_m_s))
        speed = min(speed, FASTEST_M_S) if np.isfinite(speed) else FASTEST_M_S
        return min(self._known_m, FARTHEST_M) + (speed + WALKED_M_S) * away_s, YAW_RAD + YAW_RAD_S * min(
            away_s, LONGEST_S
        )

    def place(self, started: Filter, stamp_ns: int) -> Filter:
        """A fresh start, moved and turned about the vertical: heading kept, the way gone at the mean speed."""
        old, new = self._state, started.state
        if old is None or not np.isfinite(old.flat()).all():
            return started
        across = old.rotation @ new.rotation.T
        yaw = np.arctan2(across[1, 0], across[0, 0])
        c, s = np.cos(yaw), np.sin(yaw)
        about = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        velocity = about @ new.velocity_m_s
        gone_s = min(max((stamp_ns - self._stamp_ns) * 1e-9, 0.0), LONGEST_S)
        position = old.position_m + 0.5 * gone_s * (old.velocity_m_s + velocity)
        started.state = replace(new, rotation=about @ new.rotation, position_m=position, velocity_m_s=velocity)
        spin = np.eye(ERRORS)
        spin[POSITION, POSITION] = spin[VELOCITY, VELOCITY] = about
        started.covariance = spin @ started.covariance @ spin.T
        return started
