"""Masked correlation at every shift by FFT (Padfield 2012), for one turn after another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import fft, ndimage

from pipeline.alignment.grid import Array, Grid, Mask
from pipeline.alignment.layers import Layer
from pipeline.alignment.transform import rotation

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """The fixed layer's part of all sums, transformed once. reach: greatest shift in cells."""

    grid: Grid
    reach: int
    spectra: npt.NDArray[np.complex64]
    """(3, ...) of mask, values, squares."""
    shape: tuple[int, int]


def window(fixed: Array, known: Mask, grid: Grid, reach: int) -> Window:
    """On a grid that holds the moved map with `reach` cells around it: then nothing wraps around."""
    wide, high = (fft.next_fast_len(size, real=True) for size in grid.shape)
    parts = np.stack([known, fixed, fixed * fixed]).astype(np.float32)
    spectra = fft.rfft2(parts * known, (wide, high))
    return Window(grid, reach, spectra, (wide, high))


def shift_sums(at: Window, values: Array, weight: Array) -> Array:
    """(2 reach + 1, 2 reach + 1, 6) as columns of `pose_sums`, values being moved by each shift along x and y.

    values, weight: (nx, ny) on the window's grid.
    """
    parts = np.stack([weight, values * weight, values * values * weight]).astype(np.float32)
    one, b, bb = np.conj(fft.rfft2(parts, at.shape))
    known, a, aa = at.spectra
    products = np.stack([one * known, one * a, b * known, one * aa, bb * known, b * a])
    found = fft.irfft2(products, at.shape)
    lags = np.arange(-at.reach, at.reach + 1)
    return np.asarray(np.moveaxis(found[:, lags[:, None], lags[None, :]], 0, -1), np.float64)


def turned(of: Layer, grid: Grid, onto: Grid, pivot_m: Array, yaw_deg: float) -> tuple[Array, Array]:
    """Values and weights (0 or 1) of the moved layer, turned about the pivot, on another grid."""
    places = (onto.centres_m() - pivot_m) @ rotation(yaw_deg) + pivot_m
    at = np.moveaxis(grid.fractional(places), -1, 0)
    weight = ndimage.map_coordinates(of.seen.astype(np.float32), at, order=1, mode="constant", output=np.float32)
    values = ndimage.map_coordinates(
        np.where(of.seen, of.moving, 0.0).astype(np.float32), at, order=1, mode="constant", output=np.float32
    )
    inside = weight > 0.5
    return np.where(inside, values / np.where(inside, weight, 1.0), 0.0), inside.astype(np.float32)
