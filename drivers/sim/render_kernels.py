"""Software rasteriser of the simulated camera: stems, branches, boxes and pictures of leaves.

Conventions of all kernels: rgb (h, w, 3) uint8 and depth (h, w) float32 (metres along the optical axis) are written
where something is nearer; lens = (fx, fy, cx, cy); turn (3, 3) takes world directions into the optical frame;
eye (3,) is the camera in the world.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

_jit = nb.njit(cache=True, nogil=True, fastmath=True, boundscheck=False)

FAR_M = 38.0
HAZE = (176.0, 188.0, 184.0)
HAZE_M = 75.0
NEAR_M = 0.25
NOTHING_M = 1e6
"""Depth where nothing is near."""


@_jit
def _to_camera(turn, eye, x, y, z):
    dx, dy, dz = x - eye[0], y - eye[1], z - eye[2]
    return (
        turn[0, 0] * dx + turn[0, 1] * dy + turn[0, 2] * dz,
        turn[1, 0] * dx + turn[1, 1] * dy + turn[1, 2] * dz,
        turn[2, 0] * dx + turn[2, 1] * dy + turn[2, 2] * dz,
    )


@_jit
def _put(rgb, depth, v, u, z, red, green, blue):
    haze = z / (z + HAZE_M)
    rgb[v, u, 0] = np.uint8(red * (1.0 - haze) + HAZE[0] * haze)
    rgb[v, u, 1] = np.uint8(green * (1.0 - haze) + HAZE[1] * haze)
    rgb[v, u, 2] = np.uint8(blue * (1.0 - haze) + HAZE[2] * haze)
    depth[v, u] = z


@_jit
def draw_stems(rgb, depth, lens, turn, eye, chosen, base, top, radius_base, radius_top, species, tape, bark):
    """Each stem in slices of its length, each slice a trapezoid shaded as a cylinder."""
    for k in chosen:
        length = top[k, 2] - base[k, 2]
        slices = 12
        before = _slice_at(lens, turn, eye, base[k], top[k], radius_base[k], radius_top[k], 0.0)
        for s in range(1, slices + 1):
            # finer near the ground, where the camera is
            share = (s / slices) ** 2
            here = _slice_at(lens, turn, eye, base[k], top[k], radius_base[k], radius_top[k], share)
            if before[2] > NEAR_M and here[2] > NEAR_M:
                low = base[k, 2] + length * ((s - 1) / slices) ** 2
                high = base[k, 2] + length * share
                _stem_slice(rgb, depth, before, here, low, high, bark[species[k]], tape[k], k)
            before = here


@_jit
def _slice_at(lens, turn, eye, base, top, radius_base, radius_top, share):
    """Image x, y, depth and half width in pixels of a stem at a share of its length."""
    x, y, z = _to_camera(
        turn,
        eye,
        base[0] + (top[0] - base[0]) * share,
        base[1] + (top[1] - base[1]) * share,
        base[2] + (top[2] - base[2]) * share,
    )
    if z <= NEAR_M:
        return 0.0, 0.0, z, 0.0
    radius = radius_base + (radius_top - radius_base) * share
    return lens[0] * x / z + lens[2], lens[1] * y / z + lens[3], z, lens[0] * radius / z


@_jit
def _stem_slice(rgb, depth, low, high, low_m, high_m, bark, tape, k):
    rows, columns = depth.shape
    upper, lower = (high, low) if high[1] < low[1] else (low, high)
    span = lower[1] - upper[1]
    if span < 0.5:
        return
    widen = math.sqrt(1.0 + ((lower[0] - upper[0]) / span) ** 2)
    for v in range(max(0, int(math.ceil(upper[1]))), min(rows, int(math.ceil(lower[1])))):
        f = (v - upper[1]) / span
        centre = upper[0] + (lower[0] - upper[0]) * f
        half = max((upper[3] + (lower[3] - upper[3]) * f) * widen, 0.4)
        z = upper[2] + (lower[2] - upper[2]) * f
        along_m = high_m + (low_m - high_m) * f if high[1] < low[1] else low_m + (high_m - low_m) * f
        texture_row = int(along_m * 40.0 + k * 7) & 63
        taped = tape[0] < along_m < tape[1]
        for u in range(max(0, int(math.ceil(centre - half))), min(columns, int(centre + half) + 1)):
            if z >= depth[v, u]:
                continue
            across = min(max((u - centre) / half, -1.0), 1.0)
            light = 0.45 + 0.6 * math.sqrt(1.0 - across * across) + 0.12 * across
            texel = bark[texture_row, (int((across * (1.3 - 0.3 * across * across)) * 16.0) + 32 + k * 11) & 63]
            if taped:
                _put(rgb, depth, v, u, z, 235.0 * light, 228.0 * light, 120.0 * light)
            else:
                _put(rgb, depth, v, u, z, texel[0] * light, texel[1] * light, texel[2] * light)


@_jit
def draw_branches(rgb, depth, lens, turn, eye, chosen, start, end, radius, species, bark, reach_m):
    """Thick lines stepped along their longer image axis, near ones only."""
    rows, columns = depth.shape
    for k in chosen:
        x0, y0, z0 = _to_camera(turn, eye, start[k, 0], start[k, 1], start[k, 2])
        x1, y1, z1 = _to_camera(turn, eye, end[k, 0], end[k, 1], end[k, 2])
        if z0 <= NEAR_M or z1 <= NEAR_M or z0 > reach_m:
            continue
        u0, v0 = lens[0] * x0 / z0 + lens[2], lens[1] * y0 / z0 + lens[3]
        u1, v1 = lens[0] * x1 / z1 + lens[2], lens[1] * y1 / z1 + lens[3]
        if max(u0, u1) < 0.0 or min(u0, u1) >= columns or max(v0, v1) < 0.0 or min(v0, v1) >= rows:
            continue
        steep = abs(v1 - v0) > abs(u1 - u0)
        count = int(min(max(abs(v1 - v0), abs(u1 - u0)), 1500.0)) + 1
        for s in range(count):
            f = s / count
            z = z0 + (z1 - z0) * f
            half = max(int(lens[0] * radius[k] / z), 0)
            u, v = int(u0 + (u1 - u0) * f), int(v0 + (v1 - v0) * f)
            for w in range(-half, half + 1):
                uu, vv = (u + w, v) if steep else (u, v + w)
                if 0 <= uu < columns and 0 <= vv < rows and z < depth[vv, uu]:
                    texel = bark[species[k], (s + k) & 63, (w * 9 + k) & 63]
                    _put(rgb, depth, vv, uu, z, texel[0] * 0.85, texel[1] * 0.85, texel[2] * 0.85)


@_jit
def draw_foliage(rgb, depth, lens, turn, eye, chosen, centre, half_m, species, rgba, start, sizes):
    """Pastes the picture of each clump, facing the camera; half_m (n, 2) is its half width and height."""
    rows, columns = depth.shape
    for k in chosen:
        x, y, z = _to_camera(turn, eye, centre[k, 0], centre[k, 1], centre[k, 2])
        if z < 0.5 or z > FAR_M:
            continue
        half_u, half_v = lens[0] * half_m[k, 0] / z, lens[1] * half_m[k, 1] / z
        u, v = lens[0] * x / z + lens[2], lens[1] * y / z + lens[3]
        if half_u < 0.7 or u + half_u < 0 or u - half_u >= columns or v + half_v < 0 or v - half_v >= rows:
            continue
        level = 0
        while level + 1 < sizes.size and sizes[level + 1] >= 2.0 * half_u:
            level += 1
        size = sizes[level]
        first = start[species[k], k % start.shape[1], level]
        haze = z / (z + HAZE_M)
        light = np.float32((0.72 + 0.5 * ((k * 2654435761) % 1024) / 1024.0) * (1.0 - haze))
        red, green, blue = np.float32(HAZE[0] * haze), np.float32(HAZE[1] * haze), np.float32(HAZE[2] * haze)
        scale_u, scale_v = size / (2.0 * half_u), size / (2.0 * half_v)
        mirrored = (k >> 3) & 1
        low, high = max(0, int(u - half_u) + 1), min(columns, int(u + half_u) + 1)
        for vv in range(max(0, int(v - half_v) + 1), min(rows, int(v + half_v) + 1)):
            line = first + min(int((vv - v + half_v) * scale_v), size - 1) * size
            for uu in range(low, high):
                if z >= depth[vv, uu]:
                    continue
                column = min(int((uu - u + half_u) * scale_u), size - 1)
                pixel = line + (size - 1 - column if mirrored else column)
                if rgba[pixel, 3]:
                    rgb[vv, uu, 0] = np.uint8(min(rgba[pixel, 0] * light + red, np.float32(255.0)))
                    rgb[vv, uu, 1] = np.uint8(min(rgba[pixel, 1] * light + green, np.float32(255.0)))
                    rgb[vv, uu, 2] = np.uint8(min(rgba[pixel, 2] * light + blue, np.float32(255.0)))
                    depth[vv, uu] = z


@_jit
def draw_faces(rgb, depth, lens, turn, eye, corners, colours):
    """Flat quads (n, 4, 3) of one colour each, (n, 3); those that cross the near plane are left out."""
    rows, columns = depth.shape
    image = np.empty((4, 3))
    for k in range(corners.shape[0]):
        behind = False
        for c in range(4):
            x, y, z = _to_camera(turn, eye, corners[k, c, 0], corners[k, c, 1], corners[k, c, 2])
            behind |= z <= NEAR_M
            image[c, 0], image[c, 1], image[c, 2] = lens[0] * x / z + lens[2], lens[1] * y / z + lens[3], z
        if behind or image[:, 2].min() > FAR_M:
            continue
        for v in range(max(0, int(math.ceil(image[:, 1].min()))), min(rows, int(image[:, 1].max()) + 1)):
            left, right, z_left, z_right = 1e9, -1e9, 0.0, 0.0
            for c in range(4):
                n = (c + 1) & 3
                v0, v1 = image[c, 1], image[n, 1]
                if (v0 <= v) == (v1 <= v):
                    continue
                f = (v - v0) / (v1 - v0)
                u = image[c, 0] + (image[n, 0] - image[c, 0]) * f
                z = image[c, 2] + (image[n, 2] - image[c, 2]) * f
                if u < left:
                    left, z_left = u, z
                if u > right:
                    right, z_right = u, z
            for u in range(max(0, int(math.ceil(left))), min(columns, int(right) + 1)):
                z = z_left + (z_right - z_left) * (u - left) / max(right - left, 1e-6)
                if z < depth[v, u]:
                    _put(rgb, depth, v, u, z, colours[k, 0], colours[k, 1], colours[k, 2])
