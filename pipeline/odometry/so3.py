"""Rotations in three dimensions, compiled: exponential, logarithm and right Jacobians.

Sums are written out here and in the kernels: products of arrays, and arrays put into arrays, take seconds to compile.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Doubles = npt.NDArray[np.float64]
SMALL_RAD = 1e-6


@njit(cache=True, nogil=True)
def hat(v: Doubles) -> Doubles:
    """Cross-product matrix (3, 3) of v (3,)."""
    out = np.zeros((3, 3))
    out[0, 1], out[0, 2], out[1, 2] = -v[2], v[1], -v[0]
    out[1, 0], out[2, 0], out[2, 1] = v[2], -v[1], v[0]
    return out


@njit(cache=True, nogil=True)
def cross(a: Doubles, b: Doubles) -> Doubles:
    """a x b, each (3,); numpy's takes 20 us for it."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@njit(cache=True, nogil=True)
def norm(v: Doubles) -> float:
    """Length of v (3,)."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@njit(cache=True, nogil=True)
def exp(v: Doubles) -> Doubles:
    """Rotation (3, 3) of a rotation vector (3,), by Rodrigues."""
    angle = norm(v)
    k = hat(v)
    if angle < SMALL_RAD:
        return np.eye(3) + k + 0.5 * k @ k
    return np.eye(3) + math.sin(angle) / angle * k + (1.0 - math.cos(angle)) / (angle * angle) * (k @ k)


@njit(cache=True, nogil=True)
def log(r: Doubles) -> Doubles:
    """Rotation vector (3,) of a rotation (3, 3), up to half a turn."""
    out = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    sine = 0.5 * math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    angle = math.atan2(sine, 0.5 * (r[0, 0] + r[1, 1] + r[2, 2] - 1.0))
    if angle < SMALL_RAD:
        return 0.5 * out
    if math.pi - angle > SMALL_RAD:
        return 0.5 * angle / sine * out
    # Half a turn: the axis is the largest column of (R + I) / 2.
    outer = 0.5 * (r + np.eye(3))
    k = int(np.argmax(np.diag(outer)))
    return angle * outer[:, k] / math.sqrt(outer[k, k])


@njit(cache=True, nogil=True)
def right_jacobian(v: Doubles) -> Doubles:
    """Jr (3, 3): Exp(v + d) = Exp(v) Exp(Jr d)."""
    angle = norm(v)
    k = hat(v)
    if angle < 1e-4:
        return np.eye(3) - 0.5 * k + k @ k / 6.0
    square = angle * angle
    return np.eye(3) - (1.0 - math.cos(angle)) / square * k + (angle - math.sin(angle)) / (square * angle) * (k @ k)


@njit(cache=True, nogil=True)
def right_jacobian_inverse(v: Doubles) -> Doubles:
    """Inverse of Jr (3, 3)."""
    angle = norm(v)
    k = hat(v)
    if angle < 1e-4:
        return np.eye(3) + 0.5 * k + k @ k / 12.0
    scale = 1.0 / (angle * angle) - (1.0 + math.cos(angle)) / (2.0 * angle * math.sin(angle))
    return np.eye(3) + 0.5 * k + scale * (k @ k)


@njit(cache=True, nogil=True)
def across(direction: Doubles) -> Doubles:
    """Two axes (3, 2) across a direction (3,), smooth around straight down."""
    down = direction / norm(direction)
    first = np.array([1.0 - down[0] * down[0], -down[0] * down[1], -down[0] * down[2]])
    first /= norm(first)
    second = cross(down, first)
    axes = np.empty((3, 2))
    for i in range(3):
        axes[i, 0], axes[i, 1] = first[i], second[i]
    return axes


@njit(cache=True, nogil=True)
def upright(direction: Doubles) -> Doubles:
    """The shortest rotation (3, 3) that turns a direction (3,) straight up."""
    up = direction / norm(direction)
    axis = cross(up, np.array([0.0, 0.0, 1.0]))
    sine = norm(axis)
    if sine < 1e-12:
        return np.eye(3)
    return exp(axis / sine * math.atan2(sine, up[2]))
