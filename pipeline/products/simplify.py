"""Fewer points on a line that looks the same (Douglas and Peucker 1973)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def simplified(points_m: npt.NDArray[np.float64], within_m: float) -> npt.NDArray[np.intp]:
    """Indices of the points (n, d) to keep, so that none that is left out is farther than `within_m` from the line."""
    keep = np.zeros(len(points_m), bool)
    if len(points_m):
        keep[[0, -1]] = True
    waiting = [(0, len(points_m) - 1)]
    while waiting:
        first, last = waiting.pop()
        if last - first < 2:
            continue
        away = _distances(points_m[first + 1 : last], points_m[first], points_m[last])
        farthest = int(np.argmax(away))
        if away[farthest] > within_m:
            middle = first + 1 + farthest
            keep[middle] = True
            waiting += [(first, middle), (middle, last)]
    return np.flatnonzero(keep)


def _distances(
    points: npt.NDArray[np.float64], start: npt.NDArray[np.float64], end: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Of points (n, d) from a segment."""
    along = end - start
    length2 = float(along @ along)
    share = np.clip((points - start) @ along / length2, 0.0, 1.0) if length2 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - start - share[:, None] * along, axis=1))
