"""Inertial messages of any driver as `ImuSample`: m/s^2, whatever was written."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from drivers.messages import ImuSample
from edge.errors import FormatError
from edge.replay.store import Raw
from edge.ros.decode import decode_imu

GRAVITY_M_S2 = 9.80665
_G = (0.5, 2.0)
_SI = (5.0, 20.0)
"""What the median of |acceleration| can be in each unit, in motion too."""


@dataclass(frozen=True, slots=True)
class ImuLayout:
    """scale: brings the acceleration to m/s^2."""

    scale: float
    frame_id: str

    @property
    def unit(self) -> str:
        """Of the recording."""
        return "m/s^2" if self.scale == 1.0 else "g"

    def sample(self, raw: Raw) -> ImuSample | None:
        """None for values that are no numbers."""
        imu = decode_imu(raw.data)
        wx, wy, wz = imu.angular_velocity
        ax, ay, az = imu.linear_acceleration
        if not math.isfinite(wx + wy + wz + ax + ay + az):
            return None
        k = self.scale
        return ImuSample(imu.stamp_ns, raw.log_ns, (wx, wy, wz), (ax * k, ay * k, az * k))


def find_layout(topic: str, some: Iterable[Raw]) -> ImuLayout:
    """Unit from the length of the acceleration. FormatError where it is that of gravity in neither unit."""
    found = [decode_imu(raw.data) for raw in some]
    if not found:
        raise FormatError(f"{topic}: there is no message on it")
    length = float(np.median([math.hypot(*imu.linear_acceleration) for imu in found]))
    if _SI[0] <= length <= _SI[1]:
        return ImuLayout(1.0, found[0].frame_id)
    if _G[0] <= length <= _G[1]:
        return ImuLayout(GRAVITY_M_S2, found[0].frame_id)
    raise FormatError(
        f"{topic}: the median acceleration is {length:.3g}, which is gravity neither in m/s^2 (9.8) nor in g (1). "
        "A driver that takes gravity out, or an accelerometer that is off, cannot be used; record raw acceleration"
    )
