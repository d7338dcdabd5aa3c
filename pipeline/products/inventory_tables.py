"""Measured trees as tables: GeoPackage with styles, CSV."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyproj
import shapely

from pipeline.inventory.tagged import Unmatched
from pipeline.inventory.trees import ListedTree, RejectedTree, TreeList
from pipeline.products.occurrences import Columns, text
from pipeline.products.tables import write_csv
from pipeline.products.vector import LOCAL_CRS, Layer, write_layer

Figures = npt.NDArray[np.float64]


def tree_columns(trees: Sequence[ListedTree]) -> Columns:
    """One row a tree; lengths in metres unless the name says otherwise."""

    def figures(values: list[float], digits: int) -> Figures:
        return np.asarray(np.round(np.array(values, np.float64), digits), np.float64)

    stems = [tree.stem for tree in trees]
    nan = float("nan")
    return {
        "tree_id": np.array([tree.tree_id for tree in trees], np.int32),
        "x": figures([tree.position_m[0] for tree in trees], 3),
        "y": figures([tree.position_m[1] for tree in trees], 3),
        "z_ground": figures([tree.position_m[2] for tree in trees], 3),
        "dbh_cm": figures([100 * tree.dbh_m for tree in trees], 1),
        "dbh_sd_cm": figures([100 * tree.dbh_sigma_m for tree in trees], 2),
        "height_m": figures([tree.height_m for tree in trees], 1),
        "crown_m": figures([tree.crown_m for tree in trees], 1),
        "lean_deg": figures([stem.lean_deg if stem else nan for stem in stems], 1),
        "quality": figures([stem.quality if stem else nan for stem in stems], 2),
        "arc_deg": figures([stem.arc_deg if stem else nan for stem in stems], 0),
        "inliers": figures([stem.inlier_share if stem else nan for stem in stems], 2),
        "slices": np.array([len(stem.slices) if stem else 0 for stem in stems], np.int32),
        "slice_sd_cm": figures([200 * stem.slice_spread_m if stem else nan for stem in stems], 2),
        "points": np.array([stem.points if stem else 0 for stem in stems], np.int32),
        "range_m": figures([stem.range_m if stem else nan for stem in stems], 1),
        "fitted_cm": figures([100 * stem.fitted_dbh_m if stem else nan for stem in stems], 1),
        "taped": np.array([bool(stem and stem.taped) for stem in stems]),
        "status": text([tree.status for tree in trees]),
        "species": text([tree.species for tree in trees]),
        "species_probability": figures([tree.probability for tree in trees], 3),
        "n_views": np.array([tree.views for tree in trees], np.int32),
        "n_hits": np.array([tree.hits for tree in trees], np.int32),
        "tag": text([tree.tag for tree in trees]),
        "field_dbh_cm": figures([100 * tree.field_dbh_m for tree in trees], 1),
        "note": text([tree.note for tree in trees]),
    }


def rejected_columns(rejected: Sequence[RejectedTree]) -> Columns:
    """One row a place that is no tree, with the reason."""
    places = np.array([one.position_m for one in rejected]).reshape(-1, 3).round(3)
    return {
        "x": places[:, 0],
        "y": places[:, 1],
        "dbh_cm": np.round(np.array([100 * one.dbh_m for one in rejected], np.float64), 1),
        "reject_reason": text([one.reason for one in rejected]),
    }


def unmatched_columns(unmatched: Sequence[Unmatched]) -> Columns:
    """One row a listed tree without a stem."""
    places = np.array([one.position_m for one in unmatched]).reshape(-1, 2).round(3)
    return {
        "tag": text([one.tree.tag for one in unmatched]),
        "x": places[:, 0],
        "y": places[:, 1],
        "dbh_cm": np.round(np.array([100 * one.tree.dbh_m for one in unmatched], np.float64), 1),
        "species": text([one.tree.species for one in unmatched]),
        "why": text([one.why for one in unmatched]),
    }


def write_trees_csv(path: Path, given: TreeList) -> None:
    """Header and all, also of no trees."""
    write_csv(path, tree_columns(given.trees))


def write_rejected_csv(path: Path, given: TreeList) -> None:
    """What looked like a stem, and why it is none."""
    write_csv(path, rejected_columns(given.rejected))


def write_unmatched_csv(path: Path, unmatched: Sequence[Unmatched]) -> None:
    """Listed trees that no stem was found for, and why."""
    write_csv(path, unmatched_columns(unmatched))


def write_trees_gpkg(path: Path, given: TreeList, crs: pyproj.CRS | None) -> None:
    """Layers `trees` and `rejected`, in the map's reference system or local."""
    path.unlink(missing_ok=True)
    system = LOCAL_CRS if crs is None else _horizontal(crs)
    at = np.array([tree.position_m for tree in given.trees]).reshape(-1, 3)
    write_layer(path, Layer("trees", "Point Z", system), shapely.points(at), tree_columns(given.trees))
    off = np.array([one.position_m for one in given.rejected]).reshape(-1, 3)
    write_layer(path, Layer("rejected", "Point Z", system), shapely.points(off), rejected_columns(given.rejected))


def _horizontal(crs: pyproj.CRS) -> str:
    """GeoPackage takes no compound systems; heights stay what they are."""
    flat = crs.sub_crs_list[0] if crs.is_compound else crs
    code = flat.to_epsg()
    return f"EPSG:{code}" if code else flat.to_wkt()
