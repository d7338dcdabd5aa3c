"""`odom` kept level, though at the start the accelerometer's bias could not be told from tilt.

The filter's own frame is tilted by that bias (0.5 degrees for 8 milli-g) and stays so; gravity in it becomes known
within some metres. What is published is turned upright about the sensor's place at the time: nothing ever jumps, and
what comes after is level. A frame left tilted would climb 1 m in 100 m of level ground.
"""

from __future__ import annotations

import numpy as np

from pipeline.odometry.drift import level
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.state import State


class Upright:
    """The transform from the filter's frame to the level one."""

    def __init__(self) -> None:
        self.turn: Doubles = np.eye(3)
        self._shift: Doubles = np.zeros(3)

    def follow(self, state: State) -> None:
        """Turn about where the sensor is, as gravity is known now; heading is kept."""
        here = self.turn @ state.position_m + self._shift
        self.turn = level(self.turn @ state.gravity_m_s2) @ self.turn
        self._shift = here - self.turn @ state.position_m

    def position(self, state: State) -> Doubles:
        """Of the sensor (3,), level."""
        return np.asarray(self.turn @ state.position_m + self._shift)
