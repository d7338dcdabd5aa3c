"""One box in one image, as a place: the bearing of its middle, and the range of what stands out in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.depth import DepthImage

Array = npt.NDArray[np.float64]
BIN_M = 0.4
ACROSS, ALONG = 0.22, 0.35
"""Widths of the weights about a box's middle, as shares of its sides: a tree fills the middle, what is beside it the
corners."""
FEWEST_CELLS = 6
DENSE = 0.6
"""The nearest peak with so much of the highest one's weight is the tree: it hides what is behind it, in part."""
LOW_M = 0.25
CUT_PX = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """place_m: (2,) where the bearing meets the range; ahead (2,): unit, that way. sigma_m: along it, and across.

    range_m: horizontal, of the near side. cells: (rows, cols) of the depth image that belong to it.
    """

    box_px: tuple[float, float, float, float]
    confidence: float
    place_m: Array
    ahead: Array
    sigma_m: tuple[float, float]
    range_m: float
    cells: npt.NDArray[np.bool_]

    @property
    def covariance(self) -> Array:
        """(2, 2) of the place."""
        along, across = self.sigma_m
        aside = np.array([-self.ahead[1], self.ahead[0]])
        return along**2 * np.outer(self.ahead, self.ahead) + across**2 * np.outer(aside, aside)


def sight(box_px: Array, confidence: float, depth: DepthImage, config: GroundingConfig) -> Sighting | None:
    """None where the box holds nothing of the map within range."""
    rows, cols = _cells_within(box_px, depth)
    inside = depth.places_m[rows, cols]
    away = inside[..., :2] - depth.view.position_m[:2]
    ranges = np.hypot(away[..., 0], away[..., 1])
    known = np.isfinite(ranges)
    if known.sum() < FEWEST_CELLS:
        return None
    known[known] &= inside[known][:, 2] - depth.ground.at(inside[known][:, :2]) > LOW_M
    weights = _weights(box_px, depth, rows, cols) * known
    beyond = _beyond(rows, cols, depth, config.farthest_m)
    found = _mode(ranges[known], weights[known], beyond, config.farthest_m)
    if found is None:
        return None
    middle, half = found
    chosen = known & (np.abs(np.where(known, ranges, np.inf) - middle) <= half)
    cells = np.zeros(depth.range_m.shape, np.bool_)
    cells[rows, cols] = chosen
    ahead, across_m = _bearing(box_px, middle, depth, config)
    place = depth.view.position_m[:2] + (middle + config.near_side_m) * ahead
    x0, y0, x1, y1 = box_px.tolist()
    sigma_m = (config.range_sigma_m, across_m)
    return Sighting((x0, y0, x1, y1), confidence, place, ahead, sigma_m, middle, cells)


def _cells_within(box_px: Array, depth: DepthImage) -> tuple[slice, slice]:
    shape = depth.range_m.shape
    x0, y0, x1, y1 = box_px / depth.cell_px
    rows = slice(int(np.clip(y0, 0, shape[0] - 1)), int(np.clip(np.ceil(y1), 1, shape[0])))
    cols = slice(int(np.clip(x0, 0, shape[1] - 1)), int(np.clip(np.ceil(x1), 1, shape[1])))
    return rows, cols


def _weights(box_px: Array, depth: DepthImage, rows: slice, cols: slice) -> Array:
    x0, y0, x1, y1 = box_px
    u = (np.arange(cols.start, cols.stop) + 0.5) * depth.cell_px
    v = (np.arange(rows.start, rows.stop) + 0.5) * depth.cell_px
    across = np.exp(-0.5 * ((u - 0.5 * (x0 + x1)) / max(ACROSS * (x1 - x0), depth.cell_px)) ** 2)
    along = np.exp(-0.5 * ((v - 0.5 * (y0 + y1)) / max(ALONG * (y1 - y0), depth.cell_px)) ** 2)
    return np.asarray(along[:, None] * across)


def _beyond(rows: slice, cols: slice, depth: DepthImage, farthest_m: float) -> Array:
    """By bin of range, how much of the box's middle columns goes on above and below it, beside what is in it, 0..1."""
    third = (cols.stop - cols.start) // 3
    middle = slice(cols.start + third, max(cols.stop - third, cols.start + third + 1))
    half = (rows.stop - rows.start) // 2
    parts = (slice(max(rows.start - half, 0), rows.start), rows, slice(rows.stop, rows.stop + half))
    above, inside, below = (_histogram(depth, part, middle, farthest_m) for part in parts)
    return np.asarray(np.clip(np.maximum(above, below) / np.maximum(inside, 1e-6), 0.0, 1.0))


def _histogram(depth: DepthImage, rows: slice, cols: slice, farthest_m: float) -> Array:
    """Share of the cells of a part of the image in each bin of range, smoothed."""
    bins = int(np.ceil(farthest_m / BIN_M)) + 1
    places = depth.places_m[rows, cols].reshape(-1, 3)
    if not len(places):
        return np.zeros(bins)
    stands = np.isfinite(places[:, 0])
    stands[stands] &= places[stands, 2] - depth.ground.at(places[stands, :2]) > LOW_M
    ranges = np.hypot(*(places[stands, :2] - depth.view.position_m[:2]).T)
    counted = np.bincount(np.minimum((ranges / BIN_M).astype(int), bins), minlength=bins + 1)[:bins]
    return np.convolve(counted / len(places), [0.25, 0.5, 0.25], "same")


def _mode(ranges: Array, weights: Array, beyond: Array, farthest_m: float) -> tuple[float, float] | None:
    """Middle and half width (m) of the nearest dense peak of the ranges. What goes on beyond the box is not the tree
    that the box is around."""
    bins = len(beyond)
    histogram = np.bincount(np.minimum((ranges / BIN_M).astype(int), bins), weights, bins + 1)[:bins]
    smooth = np.convolve(histogram, [0.25, 0.5, 0.25], "same") * (1.05 - beyond)
    if smooth.max() <= 0.0:
        return None
    dense = np.flatnonzero(smooth >= DENSE * smooth.max())
    first = last = int(dense[0])
    while last + 1 < bins and smooth[last + 1] >= smooth[last]:  # on to the peak's top
        last += 1
    top = last
    while last + 1 < bins and smooth[last + 1] > 0.25 * smooth[top]:
        last += 1
    while first > 0 and smooth[first - 1] > 0.25 * smooth[top]:
        first -= 1
    within = (ranges >= first * BIN_M) & (ranges < (last + 1) * BIN_M)
    total = weights[within].sum()
    if total <= 0.0:
        return None
    middle = float((ranges[within] * weights[within]).sum() / total)
    return middle, max(0.5 * (last + 1 - first) * BIN_M, BIN_M)


def _bearing(box_px: Array, range_m: float, depth: DepthImage, config: GroundingConfig) -> tuple[Array, float]:
    """Horizontal unit vector (2,) to the middle of a box, and the sigma (m) across it at a range."""
    view = depth.view
    x0, _, x1, _ = box_px
    middle = 0.5 * (box_px[:2] + box_px[2:]) - 0.5  # a box counts from edges, a lens from the middles of pixels
    ray = view.rotation @ view.model.rays(middle[None])[0]
    ahead = ray[:2] / np.hypot(ray[0], ray[1])
    share = config.box_sigma
    if x0 < CUT_PX or x1 > view.model.width_px - 1 - CUT_PX:  # cut by the border: the middle is not the tree's
        share = 0.4
    box_rad = share * (x1 - x0) / view.model.focal_px[0]
    across_m = np.hypot(range_m * np.hypot(view.bearing_sigma_rad, box_rad), view.position_sigma_m)
    return ahead, float(across_m)
