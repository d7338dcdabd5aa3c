"""Rays through the scene: a walk over the cells of the terrain, each with the list of solids above it.

Solids are rows of twelve numbers, in this order of kinds:
frusta     base x y z, unit axis x y z, length, radius at base, radius a metre, reflectivity, tape lowest z, highest z
ellipsoids centre x y z, horizontal, vertical semi-axis, extinction a metre, reflectivity
boxes      centre x y z, half edges x y z, cos yaw, sin yaw, reflectivity

Numba caches a caller by the age of its own file alone: after a change here, touch lidar_kernels.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

NOTHING, GROUND, WOOD, TAPE, LEAF, MADE = 0, 1, 2, 3, 4, 5
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_A = np.uint64(0xBF58476D1CE4E5B9)
_MIX_B = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_TO_UNIT = 2.0**-53
NEAREST_M = 1e-3
Solids = npt.NDArray[np.float32]


class RayGrid(NamedTuple):
    """What a ray needs. cell_start: (rows * columns + 1) into the entries, which are sorted by lowest z in a cell."""

    origin: npt.NDArray[np.float64]
    cell_m: float
    top_m: float
    height: npt.NDArray[np.float32]
    ground: npt.NDArray[np.float32]
    cell_start: npt.NDArray[np.int32]
    cell_top: npt.NDArray[np.float32]
    entry_z: npt.NDArray[np.float32]
    entry_solid: npt.NDArray[np.int32]
    solids: npt.NDArray[np.float32]
    frusta: int
    ellipsoids: int


@njit(cache=True, nogil=True, inline="always")
def hashed(key: np.uint64, number: int) -> np.uint64:
    """splitmix64: well mixed bits of a key and a number."""
    x = key + _GOLDEN * np.uint64(number + 1)
    x = (x ^ (x >> _S30)) * _MIX_A
    x = (x ^ (x >> _S27)) * _MIX_B
    return x ^ (x >> _S31)


@njit(cache=True, nogil=True, inline="always")
def uniform(key: np.uint64, number: int) -> float:
    """Deterministic uniform number in (0, 1]."""
    return float((hashed(key, number) >> _S11) + np.uint64(1)) * _TO_UNIT


@njit(cache=True, nogil=True)
def _frustum(
    s: Solids, n: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, best: float
) -> tuple[float, float]:
    """Distance and cosine of incidence of the first crossing from outside; best when there is none nearer."""
    px, py, pz = ox - s[n, 0], oy - s[n, 1], oz - s[n, 2]
    da = dx * s[n, 3] + dy * s[n, 4] + dz * s[n, 5]
    pa = px * s[n, 3] + py * s[n, 4] + pz * s[n, 5]
    radius = s[n, 7] + s[n, 8] * pa
    slope = s[n, 8] * da
    a = 1.0 - da * da - slope * slope
    b = px * dx + py * dy + pz * dz - pa * da - radius * slope
    c = px * px + py * py + pz * pz - pa * pa - radius * radius
    disc = b * b - a * c
    if disc <= 0.0 or a <= 1e-9 or c <= 0.0:
        return best, 1.0
    t = (-b - math.sqrt(disc)) / a
    along = pa + t * da
    if t <= NEAREST_M or t >= best or along < 0.0 or along > s[n, 6]:
        return best, 1.0
    at = s[n, 7] + s[n, 8] * along
    qx, qy, qz = px + t * dx - along * s[n, 3], py + t * dy - along * s[n, 4], pz + t * dz - along * s[n, 5]
    cosine = -(qx * dx + qy * dy + qz * dz) / max(at, 1e-6)
    return t, cosine


@njit(cache=True, nogil=True)
def _ellipsoid(
    s: Solids, n: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, best: float, key: np.uint64
) -> float:
    """Distance of the leaf that stops this ray (an exponential free path in the chord), or best."""
    px, py, pz = (ox - s[n, 0]) / s[n, 3], (oy - s[n, 1]) / s[n, 3], (oz - s[n, 2]) / s[n, 4]
    ex, ey, ez = dx / s[n, 3], dy / s[n, 3], dz / s[n, 4]
    a = ex * ex + ey * ey + ez * ez
    b = px * ex + py * ey + pz * ez
    c = px * px + py * py + pz * pz - 1.0
    disc = b * b - a * c
    if disc <= 0.0:
        return best
    root = math.sqrt(disc)
    enter, leave = max((-b - root) / a, NEAREST_M), (-b + root) / a
    if leave <= enter or enter >= best:
        return best
    t = enter - math.log(uniform(key, n)) / s[n, 5]
    return t if t < leave and t < best else best


@njit(cache=True, nogil=True)
def _box(
    s: Solids, n: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, best: float
) -> tuple[float, float]:
    """Distance and cosine of incidence where the ray enters a box, or best."""
    px, py = (ox - s[n, 0]) * s[n, 6] + (oy - s[n, 1]) * s[n, 7], (oy - s[n, 1]) * s[n, 6] - (ox - s[n, 0]) * s[n, 7]
    ex, ey = dx * s[n, 6] + dy * s[n, 7], dy * s[n, 6] - dx * s[n, 7]
    enter, leave, cosine = -1e9, 1e9, 1.0
    for p, e, half in ((px, ex, s[n, 3]), (py, ey, s[n, 4]), (oz - s[n, 2], dz, s[n, 5])):
        if abs(e) < 1e-12:
            if abs(p) > half:
                return best, 1.0
            continue
        first, second = (-half - p) / e, (half - p) / e
        if first > second:
            first, second = second, first
        if first > enter:
            enter, cosine = first, abs(e)
        leave = min(leave, second)
    if enter > leave or enter <= NEAREST_M or enter >= best:
        return best, 1.0
    return enter, cosine


@njit(cache=True, nogil=True)
def _patch(
    grid: RayGrid, i: int, j: int, x: float, y: float, z: float, dx: float, dy: float, dz: float, span: float
) -> tuple[float, float]:
    """Distance from (x, y, z) on to the bilinear ground of cell (i, j) within span, or -1; and the cosine there."""
    h, cell = grid.height, grid.cell_m
    h00, east, north = h[j, i], h[j, i + 1] - h[j, i], h[j + 1, i] - h[j, i]
    twist = h[j + 1, i + 1] - h[j, i + 1] - north
    u, v = (x - grid.origin[0]) / cell - i, (y - grid.origin[1]) / cell - j
    du, dv = dx / cell, dy / cell
    a = -twist * du * dv
    b = dz - east * du - north * dv - twist * (u * dv + v * du)
    c = z - (h00 + east * u + north * v + twist * u * v)
    t = -1.0
    if c <= 0.0:
        t = 0.0
    elif abs(a) < 1e-12:
        t = -c / b if b < 0.0 else -1.0
    else:
        disc = b * b - 4.0 * a * c
        if disc >= 0.0:
            q = -0.5 * (b + math.copysign(math.sqrt(disc), b))
            first, second = q / a, (c / q if q != 0.0 else -1.0)
            if first > second:
                first, second = second, first
            t = first if first >= 0.0 else second
    if t < 0.0 or t > span:
        return -1.0, 1.0
    gx, gy = (east + twist * (v + t * dv)) / cell, (north + twist * (u + t * du)) / cell
    return t, (gx * dx + gy * dy - dz) / math.sqrt(1.0 + gx * gx + gy * gy)


@njit(cache=True, nogil=True)
def trace(
    grid: RayGrid, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, reach: float, key: np.uint64
) -> tuple[float, int, float, float, float]:
    """First thing on a ray of unit direction: distance, kind, reflectivity, cosine of incidence, radius.

    key decides, with each clump's number, which leaf stops the ray. radius: of a stem or branch, else infinite.
    """
    rows, columns = grid.height.shape[0] - 1, grid.height.shape[1] - 1
    cell, solids = grid.cell_m, grid.solids
    entry_z, entry_solid = grid.entry_z, grid.entry_solid
    gx, gy = (ox - grid.origin[0]) / cell, (oy - grid.origin[1]) / cell
    i, j = math.floor(gx), math.floor(gy)
    step_i, step_j = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    delta_i = cell / max(abs(dx), 1e-12)
    delta_j = cell / max(abs(dy), 1e-12)
    next_i = delta_i * ((i + 1 - gx) if dx > 0.0 else (gx - i))
    next_j = delta_j * ((j + 1 - gy) if dy > 0.0 else (gy - j))
    best, kind, reflectivity, cosine, radius = reach, NOTHING, 0.0, 1.0, math.inf
    t0 = 0.0
    while 0 <= i < columns and 0 <= j < rows and t0 < best:
        t1 = min(next_i, next_j)
        z0, z1 = oz + t0 * dz, oz + t1 * dz
        low, high = min(z0, z1), max(z0, z1)
        place = j * columns + i
        if low <= grid.cell_top[place]:
            floor = max(grid.height[j, i], grid.height[j, i + 1], grid.height[j + 1, i], grid.height[j + 1, i + 1])
            if low <= floor:
                t, slant = _patch(grid, i, j, ox + t0 * dx, oy + t0 * dy, z0, dx, dy, dz, t1 - t0)
                if t >= 0.0 and t0 + t < best:
                    best, kind, cosine, radius = t0 + t, GROUND, slant, math.inf
                    reflectivity = float(grid.ground[j, i])
            for entry in range(grid.cell_start[place], grid.cell_start[place + 1]):
                if entry_z[entry, 0] > high:
                    break
                if entry_z[entry, 1] < low:
                    continue
                solid = entry_solid[entry]
                if solid < grid.frusta:
                    t, slant = _frustum(solids, solid, ox, oy, oz, dx, dy, dz, best)
                    if t < best:
                        z = oz + t * dz
                        best, cosine, reflectivity, radius = t, slant, float(solids[solid, 9]), float(solids[solid, 7])
                        kind = TAPE if solids[solid, 10] <= z <= solids[solid, 11] else WOOD
                elif solid < grid.frusta + grid.ellipsoids:
                    t = _ellipsoid(solids, solid, ox, oy, oz, dx, dy, dz, best, key)
                    if t < best:
                        best, kind, cosine, reflectivity, radius = t, LEAF, 1.0, float(solids[solid, 6]), math.inf
                else:
                    t, slant = _box(solids, solid, ox, oy, oz, dx, dy, dz, best)
                    if t < best:
                        best, kind, cosine, reflectivity, radius = t, MADE, slant, float(solids[solid, 8]), math.inf
        if dz > 0.0 and z1 > grid.top_m:
            break
        t0 = t1
        if next_i < next_j:
            i += step_i
            next_i += delta_i
        else:
            j += step_j
            next_j += delta_j
    return best, kind, reflectivity, cosine, radius


@njit(cache=True, nogil=True)
def trace_many(
    grid: RayGrid,
    origins: npt.NDArray[np.float64],
    directions: npt.NDArray[np.float64],
    reach: float,
    keys: npt.NDArray[np.uint64],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.uint8]]:
    """Distance (n,), reach where nothing is hit, and kind (n,) for rays (n, 3)."""
    count = origins.shape[0]
    distance, kinds = np.empty(count), np.empty(count, np.uint8)
    for n in range(count):
        o, d = origins[n], directions[n]
        distance[n], kinds[n], _, _, _ = trace(grid, o[0], o[1], o[2], d[0], d[1], d[2], reach, keys[n])
    return distance, kinds
