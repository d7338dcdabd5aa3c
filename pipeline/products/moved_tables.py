"""Tables of trees and detections, moved as the map that they were found on."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyogrio
import pyogrio.raw
import pyproj
import shapely

from pipeline.alignment.errors import CloudError, FrameError
from pipeline.alignment.frames import Placed, flat
from pipeline.alignment.transform import Transform

Array = npt.NDArray[np.float64]
_XY = (("x", "y"), ("x_m", "y_m"), ("easting", "northing"), ("easting_m", "northing_m"))


def move_table(path: Path, into: Path, placed: Placed, found: Transform) -> int:
    """A CSV with x and y, or every layer of points of a GeoPackage or GeoJSON; returns how many places moved.

    Columns x and y, and layers in local coordinates, are taken for those of the ground map's file, and come out in the
    aerial map's coordinate system. Layers on the Earth stay in the system they are in.

    Raises `CloudError`, `FrameError`.
    """
    if path.suffix.lower() == ".csv":
        return _move_csv(path, into, placed, found)
    return _move_layers(path, into, placed, found)


def _move_csv(path: Path, into: Path, placed: Placed, found: Transform) -> int:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            rows, names = list(reader), list(reader.fieldnames or [])
        x, y = next(((a, b) for a, b in _XY if a in names and b in names), ("", ""))
        if not x:
            raise CloudError(f"{path}: no columns x and y, or easting and northing; its places are not known")
        places = np.array([[float(row[x]), float(row[y])] for row in rows]).reshape(-1, 2)
    except (OSError, ValueError) as error:
        raise CloudError(f"{path}: cannot be read as a table of places ({error})") from error
    for row, place in zip(rows, found.apply(placed.points(places)).tolist(), strict=True):
        row[x], row[y] = (f"{value:.3f}" for value in place)
    with into.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)
    return len(rows)


def _move_layers(path: Path, into: Path, placed: Placed, found: Transform) -> int:
    try:
        names = [name for name, kind in pyogrio.list_layers(path).tolist() if kind and "Point" in kind]
    except pyogrio.errors.DataSourceError as error:
        raise CloudError(f"{path}: cannot be read as a GeoPackage or a table ({error})") from error
    if not names:
        raise CloudError(f"{path}: has no layer of points")
    into.unlink(missing_ok=True)
    return sum(_move_layer(path, into, name, placed, found) for name in names)


def _move_layer(path: Path, into: Path, name: str, placed: Placed, found: Transform) -> int:
    meta, _, wkb, columns = pyogrio.raw.read(path, layer=name)
    if not meta["crs"]:
        raise FrameError(f"{path}: layer {name} names no coordinate system, so where its points lie is not known")
    points = shapely.from_wkb(wkb)
    solid = bool(len(points)) and bool(shapely.has_z(points).all())
    xyz = shapely.get_coordinates(points, include_z=solid)
    here = pyproj.CRS.from_user_input(meta["crs"])
    if here.is_engineering:
        moved, there = found.apply(placed.points(xyz)), placed.fixed_crs
    else:
        moved, there = _moved_on_the_earth(xyz, here, placed, found), here
    pyogrio.raw.write(
        into,
        np.asarray(shapely.to_wkb(shapely.points(moved)), object),
        columns,
        meta["fields"],
        layer=name,
        driver="GPKG",
        geometry_type="Point Z" if solid else "Point",
        crs=there.to_wkt() if there is not None else meta["crs"],
        append=into.exists(),
        dataset_options={} if into.exists() else {"VERSION": "1.2"},
    )
    return len(points)


def _moved_on_the_earth(xyz: Array, here: pyproj.CRS, placed: Placed, found: Transform) -> Array:
    """Heights as they are, and the shift: those of two systems are not compared here."""
    if placed.fixed_crs is None:
        raise FrameError(
            "neither map names a coordinate system: layers on the Earth cannot be moved; name it with --crs"
        )
    onto = pyproj.Transformer.from_crs(here, flat(placed.fixed_crs), always_xy=True)
    moved = found.apply(np.column_stack([*onto.transform(xyz[:, 0], xyz[:, 1]), *xyz[:, 2:].T]))
    back = onto.transform(moved[:, 0], moved[:, 1], direction="INVERSE")
    return np.column_stack([*back, *moved[:, 2:].T])
