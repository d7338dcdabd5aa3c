"""What `mapforest process` left in its folder, read back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import numpy.typing as npt
import pyogrio.raw
import shapely

from drivers.messages import GnssFix
from edge.errors import FormatError
from edge.process.product_facts import PRODUCTS_JSON, ProductFacts, read_facts
from pipeline.evaluation.trajectory import Trajectory, read_tum
from pipeline.products.covariance import PoseTable, read_covariance
from pipeline.products.earth import Site
from pipeline.products.fixes import read_fixes

Array = npt.NDArray[np.float64]
_AT_ONCE = 2_000_000
_PLACES = laspy.DecompressionSelection.base().decompress_z()
"""Of each point its place alone: that takes two fifths less time."""
_MAPS = ("map.laz", "map_local.laz")
_FINDINGS = ("findings.gpkg", "findings_local.gpkg")


@dataclass(frozen=True, slots=True, eq=False)
class Made:
    """trees: rows of the layer `detections`. searched: rings (n, 2) on the plan. placed: the way in `map`, or None.

    The plan is what is drawn from above: metres in the site's UTM grid from the datum, or those of a local session.
    """

    folder: Path
    facts: ProductFacts
    poses: PoseTable
    odom: Trajectory
    placed: Trajectory | None
    fixes: list[GnssFix] = field(default_factory=list)
    trees: list[dict[str, Any]] = field(default_factory=list)
    searched: list[Array] = field(default_factory=list)

    @property
    def unverified(self) -> int:
        """Trees that nobody has confirmed or rejected in the GeoPackage."""
        return sum(tree["verification_status"] == "unverified" for tree in self.trees)

    def plan(self, positions_m: Array) -> Array:
        """(n, 2 or 3) in the frame of the poses -> (n, 2)."""
        site = _site(self.facts)
        if site is None:
            return positions_m[:, :2]
        return site.utm(positions_m)[:, :2] - _origin(site)

    def plan_of_trees(self) -> Array:
        """(n, 2)."""
        site = _site(self.facts)
        names = ("x_m", "y_m") if site is None else ("easting", "northing")
        at = np.array([[tree[name] for name in names] for tree in self.trees]).reshape(-1, 2)
        return at if site is None else at - _origin(site)

    def cloud(self) -> Iterator[Array]:
        """(n, 3) points of the map on the plan, some at a time; nothing where there is no map."""
        path = next((self.folder / name for name in _MAPS if (self.folder / name).exists()), None)
        if path is None:
            return
        site = _site(self.facts)
        origin = np.zeros(3) if site is None else np.append(_origin(site), 0.0)
        with laspy.open(path, decompression_selection=_PLACES) as file:
            for points in file.chunk_iterator(_AT_ONCE):
                yield np.column_stack([points.x, points.y, points.z]) - origin


def read_made(folder: Path) -> Made | None:
    """None where nothing was processed. FormatError for files of another version."""
    if not (folder / PRODUCTS_JSON).exists():
        return None
    facts = read_facts(folder)
    try:
        placed, fixes = folder / "trajectory.tum", folder / "gnss.csv"
        package = next((folder / name for name in _FINDINGS if name in facts.files), None)
        return Made(
            folder,
            facts,
            read_covariance(folder / "covariance.csv"),
            read_tum(folder / "trajectory_odom.tum"),
            read_tum(placed) if placed.exists() else None,
            read_fixes(fixes) if fixes.exists() else [],
            _rows(package, "detections") if package is not None else [],
            _rings(package, facts) if package is not None else [],
        )
    except (OSError, ValueError, pyogrio.errors.DataSourceError) as error:
        raise FormatError(f"{folder}: {error}; run `mapforest process --fresh`") from error


def _rows(package: Path, layer: str) -> list[dict[str, Any]]:
    meta, _, _, fields = pyogrio.raw.read(package, layer=layer, read_geometry=False)
    return [dict(zip(meta["fields"], values, strict=True)) for values in zip(*fields, strict=True)]


def _rings(package: Path, facts: ProductFacts) -> list[Array]:
    _, _, shapes, _ = pyogrio.raw.read(package, layer="searched_area")
    site = _site(facts)
    origin = np.zeros(2) if site is None else _origin(site)
    polygons = [part for shape in shapely.from_wkb(shapes) for part in shapely.get_parts(shape)]
    return [np.array(ring.coords)[:, :2] - origin for one in polygons for ring in (one.exterior, *one.interiors)]


def _site(facts: ProductFacts) -> Site | None:
    return Site(facts.datum) if facts.georeference is not None and facts.datum is not None else None


def _origin(site: Site) -> Array:
    return site.utm(np.zeros((1, 3)))[0, :2]
