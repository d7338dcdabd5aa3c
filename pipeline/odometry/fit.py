"""How a scan fits the map, beside how scans usually do: one laid on the wrong place fits far worse."""

from __future__ import annotations

from enum import Enum

from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.estimate import Residuals
from pipeline.odometry.filter import SURPRISING

MEMORY = 0.05
"""Weight of the newest scan in what is usual: two seconds."""
WORSE_SHARE, WORSE_SQUARED = 0.7, 2.0
"""Of the usual share of matches and the usual squared distance. On the wrong place in a forest they were below 0.63 and
above 2.9 of it, on the right one after a silence above 0.74 and below 1.4."""


class Fit(Enum):
    """Of a scan."""

    GOOD = "good"
    NONE = "none"
    """Hardly anything of it meets the map."""
    WRONG = "wrong"
    """It meets the map where the inertial samples do not have it, and badly."""


class Fitting:
    """Judges scans, one after the other since a start."""

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._usual: tuple[float, float] | None = None

    def judge(self, residuals: Residuals, unheard_s: float) -> Fit:
        """unheard_s: longest silence of the inertial sensor since the scan before; then the map alone decides."""
        share = residuals.matches / max(residuals.clusters, 1)
        if share < self._config.match.least_share:
            return Fit.NONE
        unheard = unheard_s > self._config.fault.imu_gap_s
        if (unheard or residuals.surprise > SURPRISING) and self._far_worse(share, residuals.squared):
            return Fit.WRONG
        usual = self._usual or (share, residuals.squared)
        self._usual = usual[0] + MEMORY * (share - usual[0]), usual[1] + MEMORY * (residuals.squared - usual[1])
        return Fit.GOOD

    def _far_worse(self, share: float, squared: float) -> bool:
        if self._usual is None:
            return False
        return share < WORSE_SHARE * self._usual[0] or squared > WORSE_SQUARED * self._usual[1]
