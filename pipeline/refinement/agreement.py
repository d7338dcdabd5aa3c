"""Whether what two places say of two ways is the same thing, as far as the odometry between the places can tell."""

from __future__ import annotations

import math

import numpy as np

from pipeline.estimates import Array

_WITHIN_M, _SHARE, _WITHIN_RAD = 0.5, 0.03, math.radians(5.0)
"""They are no farther off than this, and that share of the way between them."""
_FARTHEST_M = 200.0
"""Of way: beyond, the odometry does not tell."""


def agree(one: Array, other: Array, at_m: Array, way_m: float) -> bool:
    """one, other: (4, 4) one way's `odom` in that of the other way, as each place has it. at_m: (3,) the first place,
    in the former. way_m: between the places, along both ways."""
    off = np.linalg.inv(one) @ other
    turned = math.acos(min(max((float(np.trace(off[:3, :3])) - 1.0) / 2.0, -1.0), 1.0))
    moved_m = float(np.linalg.norm((off @ np.append(at_m, 1.0))[:3] - at_m))
    return way_m < _FARTHEST_M and moved_m < _WITHIN_M + _SHARE * way_m and turned < _WITHIN_RAD
