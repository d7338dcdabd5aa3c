"""Polygons from trees and from what was searched, in the frame of the trees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import rasterio.features
import shapely
from rasterio.transform import Affine

from pipeline.products.coverage import CoverageGrid
from pipeline.products.earth import Site

Array = npt.NDArray[np.float64]
UNSEEN_CROWN_M = 3.0
"""Diameter that stands for a crown nobody saw."""
_CLOSED_M = 1.0
"""Slits in the searched area that are narrower than twice this are closed: LiDAR points have gaps between them."""
_SIMPLER_M = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """Neighbouring trees. members: ordinals of them. infested_m2: below their crowns; gross_m2: of the outline."""

    outline: shapely.Polygon
    members: tuple[int, ...]
    infested_m2: float
    gross_m2: float

    @property
    def percent_cover(self) -> float:
        """Of the outline, by their crowns."""
        return 100.0 * self.infested_m2 / self.gross_m2


def patches(positions_m: Array, crowns_m: Array, gap_m: float) -> list[Patch]:
    """Trees (n, 3) whose crowns (n,), diameters, come closer to each other than gap_m. The outline is that of each two
    neighbours' crowns and what lies between them; holes are filled.
    """
    radii = np.where(np.isfinite(crowns_m), crowns_m, UNSEEN_CROWN_M) / 2.0
    crowns_at = shapely.points(positions_m[:, :2])
    crowns = np.asarray(shapely.buffer(crowns_at, radii))
    pairs = shapely.STRtree(crowns).query(crowns, predicate="dwithin", distance=gap_m).T
    hulls = [shapely.convex_hull(shapely.union(crowns[a], crowns[b])) for a, b in pairs.tolist()]
    filled = [shapely.Polygon(part.exterior) for part in shapely.get_parts(shapely.union_all(hulls))]
    found = []
    for outline in shapely.get_parts(shapely.union_all(filled)):
        members = np.flatnonzero(shapely.contains(outline, crowns_at))
        infested_m2 = float(shapely.union_all(crowns[members]).area)
        found.append(Patch(outline, tuple(members.tolist()), infested_m2, float(outline.area)))
    return sorted(found, key=lambda patch: patch.members)


def searched_area(coverage: CoverageGrid) -> shapely.MultiPolygon:
    """Around every cell that an image showed, slits closed."""
    parts = []
    for (west, south), cells in coverage.blocks():
        mask = (cells.views > 0).astype(np.uint8)
        transform = Affine(coverage.cell_m, 0.0, west, 0.0, coverage.cell_m, south)
        parts += [shapely.geometry.shape(s) for s, _ in rasterio.features.shapes(mask, mask > 0, transform=transform)]
    joined = shapely.union_all(parts)
    closed = shapely.buffer(shapely.buffer(joined, _CLOSED_M), -_CLOSED_M)
    return _multi(shapely.simplify(closed, _SIMPLER_M))


def on_the_grid(shape: Any, site: Site) -> Any:
    """From `map` to the site's UTM zone."""
    return shapely.transform(shape, lambda xy: site.utm(_flat(xy))[:, :2])


def on_the_globe(shape: Any, site: Site) -> Any:
    """From `map` to longitude and latitude."""
    return shapely.transform(shape, lambda xy: site.geodetic(_flat(xy))[:, :2])


def _flat(xy: Array) -> Array:
    return np.column_stack([xy, np.zeros(len(xy))])


def _multi(shape: Any) -> shapely.MultiPolygon:
    return shapely.MultiPolygon([part for part in shapely.get_parts(shape) if part.geom_type == "Polygon"])
