"""Point slots of the simulated Mid-360: where each laser looks, what it meets, what the sensor makes of it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from drivers.sim.ray_kernels import GROUND, LEAF, NOTHING, TAPE, WOOD, RayGrid, hashed, trace, uniform

SLOT_NS = 5_000
KNOT_NS = 1_000_000
AZIMUTH_STEP_RAD = math.radians(0.3262)
ELEVATION_RAD = math.radians(23.0)
SWING_RAD = math.radians(27.0)
LASER_SPREAD_RAD = math.radians(1.95)
HORIZON_M = 100.0
BLIND_M = 0.1
UNRELIABLE_M = 2.0
# 40 m at 10 %, 70 m at 80 %: log(70 / 40) / log(80 / 10)
REACH_EXPONENT = 0.26912
LEAF_FADE_M = 28.0
BEAM_RAD = 0.0026
BEAM_M = 0.003
TAG_GLUE, TAG_GLUE_LOW, TAG_PARTICLE, TAG_PARTICLE_LOW = 1, 2, 4, 8


@njit(cache=True, nogil=True, inline="always")
def _normal(key: np.uint64, number: int) -> float:
    """About a standard normal number: four 16-bit uniforms added (no tail beyond 3.46)."""
    bits = hashed(key, number)
    total = 0.0
    for _ in range(4):
        total += float(bits & np.uint64(0xFFFF))
        bits >>= np.uint64(16)
    return (total / 65536.0 - 2.0) * 1.7320508


@njit(cache=True, nogil=True)
def look(slot: int, laser: int, wander: float, swing: float) -> tuple[float, float]:
    """Azimuth and elevation (rad) of a slot; wander and swing are the phases of the two mirrors (rad)."""
    azimuth = (slot * AZIMUTH_STEP_RAD) % (2.0 * math.pi) + wander
    spread = (laser - 1.5) * LASER_SPREAD_RAD * math.cos(azimuth)
    return azimuth, ELEVATION_RAD + SWING_RAD * math.cos(swing) + spread


@njit(cache=True, nogil=True)
def cast_slots(
    grid: RayGrid,
    knots: npt.NDArray[np.float64],
    t_ns: int,
    count: int,
    lever: npt.NDArray[np.float64],
    noise: npt.NDArray[np.float64],
    seed: np.uint64,
    xyz_mm: npt.NDArray[np.int32],
    reflectivity: npt.NDArray[np.uint8],
    tag: npt.NDArray[np.uint8],
) -> None:
    """Fills xyz_mm (n, 3), reflectivity and tag (n,) with `count` slots from `t_ns` on.

    knots: (m, 14) each `KNOT_NS` from the knot at or before t_ns: position, rotation row by row, phases of the mirrors.
    noise: range sigma (m) at zero, its growth a metre, angle sigma (rad), particles a slot, share of edges glued.
    """
    first_ns = (t_ns // KNOT_NS) * KNOT_NS
    for n in range(count):
        since = t_ns - first_ns + n * SLOT_NS
        k = since // KNOT_NS
        f = (since - k * KNOT_NS) / KNOT_NS
        a, b = knots[k], knots[k + 1]
        slot = (t_ns + n * SLOT_NS) // SLOT_NS
        key = hashed(seed, slot)
        azimuth, elevation = look(slot, n & 3, a[12] + f * (b[12] - a[12]), a[13] + f * (b[13] - a[13]))
        level = math.cos(elevation)
        nx, ny, nz = level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)
        # A small turn of the beam about two axes: the sensor reports the nominal direction.
        turn, lift = noise[2] * _normal(key, -2), noise[2] * _normal(key, -3)
        lx, ly, lz = nx - turn * ny - lift * nz * nx, ny + turn * nx - lift * nz * ny, nz + lift * level * level
        scale = 1.0 / math.sqrt(lx * lx + ly * ly + lz * lz)
        lx, ly, lz = lx * scale, ly * scale, lz * scale
        g = 1.0 - f
        r0, r1, r2 = g * a[3] + f * b[3], g * a[4] + f * b[4], g * a[5] + f * b[5]
        r3, r4, r5 = g * a[6] + f * b[6], g * a[7] + f * b[7], g * a[8] + f * b[8]
        r6, r7, r8 = g * a[9] + f * b[9], g * a[10] + f * b[10], g * a[11] + f * b[11]
        ox = g * a[0] + f * b[0] + r0 * lever[0] + r1 * lever[1] + r2 * lever[2]
        oy = g * a[1] + f * b[1] + r3 * lever[0] + r4 * lever[1] + r5 * lever[2]
        oz = g * a[2] + f * b[2] + r6 * lever[0] + r7 * lever[1] + r8 * lever[2]
        dx, dy, dz = r0 * lx + r1 * ly + r2 * lz, r3 * lx + r4 * ly + r5 * lz, r6 * lx + r7 * ly + r8 * lz
        distance, kind, albedo, cosine, radius = trace(grid, ox, oy, oz, dx, dy, dz, HORIZON_M, key)

        beam = BEAM_M + BEAM_RAD * distance
        label = 0
        seen = albedo * max(cosine, 0.05)
        if kind == LEAF:
            # The beam outgrows the leaves with distance: each takes a part, and many returns stay too weak.
            seen = albedo * (0.15 + 0.85 * uniform(key, -4))
            if uniform(key, -15) > math.exp(-distance / LEAF_FADE_M):
                kind = NOTHING
        elif kind == TAPE:
            seen = 20.0 * max(cosine, 0.05)
        elif kind == WOOD:
            seen *= min(1.0, radius / beam)
            spills = radius * (1.0 - math.sqrt(max(0.0, 1.0 - cosine * cosine))) < beam
            if spills and uniform(key, -5) < noise[4]:
                label = TAG_GLUE if uniform(key, -6) < 0.7 else TAG_GLUE_LOW
                distance += 2.0 * beam * uniform(key, -7)
        if kind != NOTHING and distance > 8.0:
            reach = 40.0 * (max(seen, 1e-4) / 0.1) ** REACH_EXPONENT
            if distance > reach * (1.0 + 0.06 * _normal(key, -8)):
                kind = NOTHING
        if uniform(key, -9) < noise[3]:
            dust = 0.3 + 4.0 * uniform(key, -10) ** 2
            if kind == NOTHING or dust < distance:
                distance, kind, seen, cosine = dust, LEAF, 0.02, 1.0
                label = TAG_PARTICLE if uniform(key, -11) < 0.5 else TAG_PARTICLE_LOW
        sigma = noise[0] + noise[1] * distance
        if distance < 0.3:
            sigma *= 2.0
        measured = distance + sigma * _normal(key, -12)
        if kind == NOTHING or measured < BLIND_M or measured > HORIZON_M:
            xyz_mm[n, 0], xyz_mm[n, 1], xyz_mm[n, 2] = 0, 0, 0
            chance = uniform(key, -13)
            reflectivity[n] = 7 + int(chance * 250.0) if chance < 0.02 else 0
            tag[n] = 128 if 0.02 <= chance < 0.05 else (192 if 0.05 <= chance < 0.07 else 0)
            continue
        xyz_mm[n, 0] = round(1000.0 * measured * nx)
        xyz_mm[n, 1] = round(1000.0 * measured * ny)
        xyz_mm[n, 2] = round(1000.0 * measured * nz)
        spread = 0.03 if measured > UNRELIABLE_M else 0.15
        if kind == TAPE:
            bright = 155.0 + 95.0 * max(cosine, 0.0) + 6.0 * _normal(key, -14)
            reflectivity[n] = int(min(255.0, max(151.0, bright)))
        else:
            shade = seen if kind in {LEAF, GROUND} else albedo * (0.5 + 0.5 * cosine)
            bright = 150.0 * shade * (1.0 + spread * _normal(key, -14))
            reflectivity[n] = int(min(150.0, max(0.0, bright)))
        tag[n] = label
