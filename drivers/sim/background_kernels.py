"""The simulated camera's background: painted ground, and the forest far away.

rgb (h, w, 3) uint8 and depth (h, w) float32 (metres along the optical axis) are written; lens = (fx, fy, cx, cy); turn
(3, 3) takes world directions into the optical frame; eye (3,) is the camera in the world.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from drivers.sim.render_kernels import FAR_M, HAZE, HAZE_M, NOTHING_M

_jit = nb.njit(cache=True, nogil=True, fastmath=True, boundscheck=False)

BLOCK = 16


@_jit
def _ground_height(height, left, bottom, cell, x, y):
    rows, columns = height.shape
    u = min(max((x - left) / cell, 0.0), columns - 1.001)
    v = min(max((y - bottom) / cell, 0.0), rows - 1.001)
    i, j = int(u), int(v)
    fu, fv = u - i, v - j
    south = height[j, i] * (1.0 - fu) + height[j, i + 1] * fu
    north = height[j + 1, i] * (1.0 - fu) + height[j + 1, i + 1] * fu
    return south * (1.0 - fv) + north * fv


@_jit
def _march(height, left, bottom, cell, eye, dx, dy, dz):
    """Depth at which a ray meets the ground, 0 when it does not within FAR_M. The ray has unit depth a step."""
    t, before = 0.4, 0.0
    while t < FAR_M:
        gap = eye[2] + t * dz - _ground_height(height, left, bottom, cell, eye[0] + t * dx, eye[1] + t * dy)
        if gap < 0.0:
            for _ in range(6):
                middle = 0.5 * (before + t)
                x, y = eye[0] + middle * dx, eye[1] + middle * dy
                if eye[2] + middle * dz < _ground_height(height, left, bottom, cell, x, y):
                    t = middle
                else:
                    before = middle
            return 0.5 * (before + t)
        before = t
        t += max(0.5, 0.9 * gap)
    return 0.0


@_jit
def paint_background(
    rgb, depth, lens, turn, eye, height, left, bottom, cell, bare, litter, soil, far, tile_m, soil_below
):
    """Ground by marching one ray a block corner and interpolating; the far forest where no ground is met."""
    rows, columns = depth.shape
    down, across = rows // BLOCK + 1, columns // BLOCK + 1
    corner = np.zeros((down, across, 6), np.float32)  # 1/depth, x/depth, y/depth, bareness, azimuth, elevation (turns)
    for j in range(down):
        for i in range(across):
            a, b = (i * BLOCK - lens[2]) / lens[0], (j * BLOCK - lens[3]) / lens[1]
            dx = turn[0, 0] * a + turn[1, 0] * b + turn[2, 0]
            dy = turn[0, 1] * a + turn[1, 1] * b + turn[2, 1]
            dz = turn[0, 2] * a + turn[1, 2] * b + turn[2, 2]
            t = _march(height, left, bottom, cell, eye, dx, dy, dz)
            if t > 0.0:
                corner[j, i, 0] = 1.0 / t
                corner[j, i, 1] = dx
                corner[j, i, 2] = dy
                corner[j, i, 3] = _ground_height(bare, left, bottom, cell, eye[0] + t * dx, eye[1] + t * dy)
            corner[j, i, 4] = math.atan2(dy, dx) / (2.0 * math.pi)
            corner[j, i, 5] = math.atan2(dz, math.sqrt(dx * dx + dy * dy)) / (2.0 * math.pi)
    for j in range(down - 1):
        for i in range(across - 1):
            ground = True
            for c in range(4):
                ground &= corner[j + (c >> 1), i + (c & 1), 0] > 0.0
            if ground:
                _ground_block(rgb, depth, corner, j, i, eye, litter, soil, tile_m, soil_below)
            else:
                _far_block(rgb, depth, corner, far, j, i)


@_jit
def _across(corner, j, i, down, field):
    """A corner field at the left edge of a block's row, and its change a pixel to the right."""
    left = corner[j, i, field] * (1.0 - down) + corner[j + 1, i, field] * down
    right = corner[j, i + 1, field] * (1.0 - down) + corner[j + 1, i + 1, field] * down
    return left, (right - left) / BLOCK


@_jit
def _ground_block(rgb, depth, corner, j, i, eye, litter, soil, tile_m, soil_below):
    mask = litter.shape[0] - 1  # the tiles' side is a power of two
    scale = litter.shape[0] / tile_m
    for row in range(BLOCK):
        down = (row + 0.5) / BLOCK
        near, near_step = _across(corner, j, i, down, 0)
        dx, dx_step = _across(corner, j, i, down, 1)
        dy, dy_step = _across(corner, j, i, down, 2)
        bare, bare_step = _across(corner, j, i, down, 3)
        v = j * BLOCK + row
        for column in range(BLOCK):
            z = np.float32(1.0) / near
            x = int(math.floor((eye[0] + dx * z) * scale)) & mask
            y = int(math.floor((eye[1] + dy * z) * scale)) & mask
            haze = z / (z + np.float32(HAZE_M))
            u = i * BLOCK + column
            on_soil = bare + 0.0004 * (np.float32(litter[y, x, 0]) - 90.0) < soil_below
            tile = soil if on_soil else litter
            for c in range(3):
                rgb[v, u, c] = np.uint8(tile[y, x, c] * (np.float32(1.0) - haze) + np.float32(HAZE[c]) * haze)
            depth[v, u] = z
            near += near_step
            dx += dx_step
            dy += dy_step
            bare += bare_step


@_jit
def _far_block(rgb, depth, corner, far, j, i):
    rows, columns = far.shape[:2]
    for row in range(BLOCK):
        down = (row + 0.5) / BLOCK
        azimuth, azimuth_step = _across(corner, j, i, down, 4)
        elevation, elevation_step = _across(corner, j, i, down, 5)
        if abs(azimuth_step) > 0.02:  # across the seam behind the viewer
            azimuth_step = 0.0
        v = j * BLOCK + row
        for column in range(BLOCK):
            y = min(max(int((60.0 - 360.0 * elevation) * rows / 90.0), 0), rows - 1)
            x = int((azimuth + 1.0) * columns) % columns
            u = i * BLOCK + column
            for c in range(3):
                rgb[v, u, c] = far[y, x, c]
            depth[v, u] = NOTHING_M
            azimuth += azimuth_step
            elevation += elevation_step
