"""A map again, each point with its height above the ground and the tree that it belongs to (LAZ 1.4)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pipeline.inventory.inventory import Inventory
from pipeline.inventory.source import MapSource, Part
from pipeline.inventory.stem import Stem
from pipeline.products.laz import SCALE_M

GROUND_M = 0.15
"""Points this near to the ground are classified as ground."""
BARK_M = 0.1
CROWN_FROM_M = 2.5
_KINDS = {"unclassified": 1, "ground": 2, "low": 3, "medium": 4, "high": 5}
_AT_ONCE = 250_000


def write_inventory_laz(path: Path, source: MapSource, found: Inventory, advance: Callable[[float], None]) -> int:
    """Returns the number of points; those with NaN, being withheld in the map, are left out."""
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = np.full(3, SCALE_M)
    header.offsets = np.floor(source.placed(np.zeros((1, 3)))[0])
    header.generating_software = "mapforest"
    header.system_identifier = "mapforest inventory"
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams("tree_id", "uint32", "0: none; else as in trees.csv"),
            laspy.ExtraBytesParams("height_above_ground", "float32", "metres"),
        ]
    )
    if source.crs is not None:
        header.add_crs(source.crs)
    count, read = 0, 0
    with laspy.open(path, mode="w", header=header, laz_backend=laspy.LazBackend.Lazrs) as writer:
        for part in source.parts():
            for start in range(0, len(part.xyz_m), _AT_ONCE):
                some = slice(start, start + _AT_ONCE)
                record = _record(Part(part.xyz_m[some], part.reflector[some]), header, source, found)
                writer.write_points(record)
                count += len(record)
            read += len(part.xyz_m)
            advance(read / source.count)
    return count


def _record(part: Part, header: laspy.LasHeader, source: MapSource, found: Inventory) -> laspy.ScaleAwarePointRecord:
    xyz = part.xyz_m[np.isfinite(part.xyz_m).all(axis=1)]
    height = found.terrain.above(xyz)
    record = laspy.ScaleAwarePointRecord.zeros(len(xyz), header=header)
    record.x, record.y, record.z = source.placed(xyz.astype(np.float64)).T
    record.return_number[:] = 1
    record.number_of_returns[:] = 1
    low, medium = height < 0.5, height < 2.0
    kinds = np.where(low, _KINDS["low"], np.where(medium, _KINDS["medium"], _KINDS["high"]))
    record.classification = np.where(np.abs(height) < GROUND_M, _KINDS["ground"], kinds).astype(np.uint8)
    record["height_above_ground"] = height
    record["tree_id"] = tree_of(xyz, height, found)
    return record


def tree_of(
    xyz_m: npt.NDArray[np.float32], height_m: npt.NDArray[np.float32], found: Inventory
) -> npt.NDArray[np.uint32]:
    """(n,) numbers of trees, 0 for none: on the bark of a stem, or within its crown."""
    if not found.stems:
        return np.zeros(len(xyz_m), np.uint32)
    owner = np.where(height_m > CROWN_FROM_M, found.canopy.owners(xyz_m[:, :2]), -1)
    axes = _Axes(found.stems)
    on = axes.nearest(xyz_m, height_m)
    number = np.where(on >= 0, on, owner) + 1
    return np.where(height_m > GROUND_M, number, 0).astype(np.uint32)


class _Axes:
    """Which stem a point lies on."""

    def __init__(self, stems: list[Stem]) -> None:
        self._base = np.array([stem.base_m[:2] for stem in stems])
        self._lean = np.array([stem.lean for stem in stems])
        self._radius = np.array([0.5 * stem.fitted_dbh_m for stem in stems])
        self._tree = cKDTree(self._base)

    def nearest(self, xyz_m: npt.NDArray[np.float32], height_m: npt.NDArray[np.float32]) -> npt.NDArray[np.int64]:
        """(n,) ordinals, -1 for none."""
        low = np.flatnonzero((height_m > GROUND_M) & (height_m < 8.0))
        out = np.full(len(xyz_m), -1, np.int64)
        if not len(low):
            return out
        k = self._tree.query(xyz_m[low, :2].astype(np.float64), workers=1)[1]
        axis = self._base[k] + self._lean[k] * height_m[low, None]
        away = np.hypot(*(xyz_m[low, :2] - axis).T)
        out[low] = np.where(away < self._radius[k] + BARK_M, k, -1)
        return out
