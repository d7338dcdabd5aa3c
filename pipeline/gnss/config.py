"""What the fusion assumes of the odometry and of the receiver. The baselines of the benchmark are settings of it."""

from __future__ import annotations

from typing import Annotated

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]


class FusionConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Sigmas are one-sigma. Infinity switches a robust part off."""

    antenna_m: tuple[float, float, float] = (-0.05, 0.0, 0.20)
    """In `base_link`."""

    stamped_late_s: float = 0.0
    """By how much the stamps of the fixes are too late; the fusion says so where it can tell."""
    drift_m: NotNegative = 0.05
    """Horizontal drift of the odometry after one metre; it grows with the root of the way: 0.5 m after 100 m."""
    drift_up_m: NotNegative = 0.05
    drift_yaw_deg: NotNegative = 0.03
    drift_scales: tuple[float, ...] = (0.3, 1.0, 3.0)
    """Multiples of these three that are tried side by side."""
    degenerate_factor: Positive = 5.0
    """The drift is that many times larger where the odometry was degenerate or had a gap."""

    sigma_floor_m: tuple[float, float, float] = (0.03, 0.3, 1.5)
    """No fix is better than that, by quality: RTK fixed, float, all others. Vertical: times `vertical_ratio`."""
    vertical_ratio: Positive = 1.6
    correlation_s: NotNegative = 20.0
    """For how long the error of a fix lasts; 0: white. Multipath changes as the antenna moves on: 10 to 60 s."""
    white_share: Positive = 0.3
    """Share of sigma that is new with each fix; the rest lasts for `correlation_s`."""
    constant_sigma_m: NotNegative = 0.0
    """Not 0: taken for every fix instead of what the receiver says (a baseline)."""
    learning_rate: NotNegative = 0.02
    """By how much a second of fixes changes the logarithm of the scale learned for the sigmas of their quality."""
    most_dishonest: Positive = 10.0

    huber: Positive = 1.345
    """Vertical; horizontally 1.5 times that: the same efficiency of 95 % in two dimensions."""
    gate: Positive = 13.8
    """Chi-square of a horizontal innovation (99.9 %); vertically 0.78 of it."""
    recover_s: Positive = 45.0
    """Rejecting for so long, the filter doubts itself. Receivers err under crowns for 10 to 60 s together."""

    yaw_known_deg: Positive = 3.0
    spacing_s: NotNegative = 0.9
    """Fixes closer than that to the last used one are left out: their errors are the same."""
    history_s: Positive = 30.0
    """How late a fix may come."""

    def scaled(self, scale: float) -> FusionConfig:
        """The same with another drift."""
        drift_m, up_m, yaw_deg = self.drift_m * scale, self.drift_up_m * scale, self.drift_yaw_deg * scale
        return msgspec.structs.replace(self, drift_m=drift_m, drift_up_m=up_m, drift_yaw_deg=yaw_deg)
