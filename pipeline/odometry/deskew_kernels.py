"""Every point moved to the end of its sweep by the motion at its own time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from pipeline.odometry.so3 import Doubles


@njit(cache=True, nogil=True)
def deskew(xyz: npt.NDArray[np.float32], time_s: Doubles, knots: Doubles, turn: Doubles, lever: Doubles) -> Doubles:
    """Points (n, 3) of the sensor, each at its own time (n,), in `base_link` at the last knot.

    turn (3, 3), lever (3,): sensor to base. Times before the first knot are taken at its motion; need not be sorted.
    """
    last = knots[len(knots) - 1]
    end = last[1:10].copy().reshape(3, 3)
    out = np.empty((len(xyz), 3))
    k = 0
    for n in range(len(xyz)):
        t = time_s[n]
        while k > 0 and knots[k, 0] > t:
            k -= 1
        while k < len(knots) - 2 and knots[k + 1, 0] <= t:
            k += 1
        dt = t - knots[k, 0]
        wx, wy, wz = knots[k, 19] * dt, knots[k, 20] * dt, knots[k, 21] * dt
        x = turn[0, 0] * xyz[n, 0] + turn[0, 1] * xyz[n, 1] + turn[0, 2] * xyz[n, 2] + lever[0]
        y = turn[1, 0] * xyz[n, 0] + turn[1, 1] * xyz[n, 1] + turn[1, 2] * xyz[n, 2] + lever[1]
        z = turn[2, 0] * xyz[n, 0] + turn[2, 1] * xyz[n, 1] + turn[2, 2] * xyz[n, 2] + lever[2]
        square = wx * wx + wy * wy + wz * wz
        # sin(a)/a and (1 - cos a)/a^2 to a^4: below 1e-9 at 35 rad/s over 5 ms.
        first = 1.0 - square / 6.0 + square * square / 120.0
        second = 0.5 - square / 24.0 + square * square / 720.0
        cx, cy, cz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
        x, y, z = (
            x + first * cx + second * (wy * cz - wz * cy),
            y + first * cy + second * (wz * cx - wx * cz),
            z + first * cz + second * (wx * cy - wy * cx),
        )
        half = 0.5 * dt * dt
        r = knots[k]
        gx = r[1] * x + r[2] * y + r[3] * z + r[10] + r[13] * dt + r[16] * half - last[10]
        gy = r[4] * x + r[5] * y + r[6] * z + r[11] + r[14] * dt + r[17] * half - last[11]
        gz = r[7] * x + r[8] * y + r[9] * z + r[12] + r[15] * dt + r[18] * half - last[12]
        out[n, 0] = end[0, 0] * gx + end[1, 0] * gy + end[2, 0] * gz
        out[n, 1] = end[0, 1] * gx + end[1, 1] * gy + end[2, 1] * gz
        out[n, 2] = end[0, 2] * gx + end[1, 2] * gy + end[2, 2] * gz
    return out
