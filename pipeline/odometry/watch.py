"""Whether the state is still worth going on from: scans fit the map, and agree with the inertial samples."""

from __future__ import annotations

import numpy as np

from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.estimate import Status
from pipeline.odometry.filter import SURPRISING, Filter
from pipeline.odometry.fit import Fit
from pipeline.odometry.state import POSITION
from pipeline.odometry.tracker import Registration

MEMORY = 0.05
"""Weight of the newest scan in the mean surprise: two seconds."""
LASTING, SETTLED = 3.0, 1.5
"""Mean surprise from which on a contradiction lasts, and below which it is over. Of 19 sound walks of all carriers one,
in a meadow, reaches 2.4 and none of the others 2; a LiDAR mounted 3 degrees off reaches 5, stamps 20 ms late 8."""


class Watch:
    """Follows the scans since a start."""

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._misfits = 0
        self._surprise = 0.0
        self.contradicted = False
        """Whether scans and inertial samples have been contradicting each other for some time."""

    def follow(self, found: Registration, unheard_s: float) -> Status:
        """What a scan says of the state. unheard_s: of the inertial sensor, within the step to this scan."""
        residuals, fit = found.residuals, found.fit
        self._misfits = 0 if fit is Fit.GOOD else self._misfits + (residuals.clusters > 0)
        if fit is not Fit.GOOD:
            return Status.COASTING
        if unheard_s < self._config.imu.longest_step_s and residuals.matches > self._config.match.effective:
            self._surprise += MEMORY * (min(residuals.surprise, SURPRISING) - self._surprise)
            self.contradicted = self._surprise > (SETTLED if self.contradicted else LASTING)
        if residuals.surprise > SURPRISING or self.contradicted:
            return Status.DOUBTFUL
        degenerate = found.observability is not None and found.observability.degenerate
        return Status.DEGENERATE if degenerate else Status.TRACKING

    def broken(self, filter_: Filter) -> str:
        """Why the state is not worth going on from; empty when it is."""
        fault = self._config.fault
        spread = np.sqrt(np.diag(filter_.covariance)[POSITION].max())
        speed = np.linalg.norm(filter_.state.velocity_m_s)
        most = fault.misfits if spread > fault.coasting_m else fault.misfits_most
        if self._misfits > most:
            return f"{self._misfits} scans in a row do not fit the map"
        if spread > fault.lost_m or not np.isfinite(spread):
            return f"position within the map is uncertain by {spread:.1f} m"
        if speed > fault.fastest_m_s:
            return f"speed of {speed:.0f} m/s"
        return ""
