"""Where a start stands in the filter's frame: at its origin at first, on the last pose after a break."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.odometry.filter import Filter
from pipeline.odometry.state import ERRORS, POSITION, VELOCITY, State

LONGEST_S = 5.0
"""The way over a longer break is not guessed from the speeds before and after."""


class Footing:
    """state, stamp_ns: the last before the break; None at the first start."""

    def __init__(self, state: State | None = None, stamp_ns: int = 0, note: str = "") -> None:
        self._state = state
        self._stamp_ns = stamp_ns
        self._note = note

    def say(self) -> str:
        """What to tell with the first estimate; once."""
        note, self._note = self._note, ""
        return note

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
