"""Trees as a field crew wrote them down: a number on a tag, a place, a diameter."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
import numpy.typing as npt
import pyproj

from pipeline.inventory.errors import InventoryError

Doubles = npt.NDArray[np.float64]
Frame = Literal["metres", "degrees", "plot"]
PLACES: dict[Frame, tuple[str, str]] = {
    "metres": ("x", "y"),
    "degrees": ("lon", "lat"),
    "plot": ("azimuth_deg", "distance_m"),
}
OTHER_NAMES = {
    **{"tag_number": "tag", "tree": "tag", "easting": "x", "northing": "y", "longitude": "lon", "latitude": "lat"},
    **{"azimuth": "azimuth_deg", "bearing_deg": "azimuth_deg", "distance": "distance_m", "dbh": "dbh_cm"},
}
LEAST_CM, MOST_CM = 1.0, 500.0


class FieldTree(msgspec.Struct, frozen=True):
    """A line of a field list. x_m, y_m: metres, or degrees east and north."""

    x_m: float
    y_m: float
    dbh_m: float
    tag: str = ""
    species: str = ""


@dataclass(frozen=True, slots=True)
class FieldList:
    """frame: what the places of the trees are. `metres`: of the map or of a grid of the crew's own; `degrees`: WGS 84;
    `plot`: east and north of a plot's centre, by a compass."""

    trees: list[FieldTree]
    frame: Frame

    @property
    def dbh_m(self) -> Doubles:
        """(n,)."""
        return np.array([tree.dbh_m for tree in self.trees])

    def places_m(self, crs: pyproj.CRS | None) -> Doubles:
        """(n, 2) in a reference system where they are degrees, in the UTM zone of the list without one."""
        at = np.array([[tree.x_m, tree.y_m] for tree in self.trees])
        if self.frame != "degrees":
            return at
        flat = crs.sub_crs_list[0] if crs is not None and crs.is_compound else crs
        if flat is None:
            zone = int(np.floor((at[0, 0] + 180.0) / 6.0)) % 60 + 1
            flat = pyproj.CRS(32600 + zone if at[0, 1] >= 0.0 else 32700 + zone)
        onto = pyproj.Transformer.from_crs(4326, flat, always_xy=True)
        return np.column_stack(onto.transform(at[:, 0], at[:, 1]))

    def on_map(self, crs: pyproj.CRS | None) -> list[FieldTree]:
        """With places in the coordinates of a map. InventoryError for a list that has none there."""
        if self.frame == "plot" or (self.frame == "degrees" and crs is None):
            kind = "measured from the centre of a plot" if self.frame == "plot" else "degrees, and the map has no place"
            raise InventoryError(f"the places of the field list are {kind}: expected x and y in the map's coordinates")
        at = self.places_m(crs)
        return [
            msgspec.structs.replace(tree, x_m=float(x), y_m=float(y))
            for tree, (x, y) in zip(self.trees, at, strict=True)
        ]


def read_field_list(path: Path) -> FieldList:
    """A CSV with dbh_cm; x and y, or lon and lat, or azimuth_deg (from north, clockwise) and distance_m from a plot's
    centre; perhaps tag and species. InventoryError names file, line and what was expected."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = [(number, line) for number, line in enumerate(file, 1) if line.strip() and line[0] != "#"]
    except (OSError, UnicodeDecodeError) as error:
        raise InventoryError(f"{path}: cannot be read ({error})") from error
    rows = csv.DictReader(line for _, line in lines)
    names = {name: OTHER_NAMES.get(name.strip().lower(), name.strip().lower()) for name in rows.fieldnames or ()}
    frame = next((frame for frame, both in PLACES.items() if set(both) <= set(names.values())), None)
    if frame is None or "dbh_cm" not in names.values():
        raise InventoryError(
            f"{path}: found the columns {', '.join(sorted(names)) or 'none'}; expected dbh_cm, and x and y, or lon and "
            "lat, or azimuth_deg and distance_m; tag and species if there are any"
        )
    found = []
    for (number, _), row in zip(lines[1:], rows, strict=False):
        named = {names[name]: (value or "").strip() for name, value in row.items() if name in names}
        found.append(_tree(f"{path}:{number}", named, frame))
    if not found:
        raise InventoryError(f"{path}: has no trees")
    tags = [tree.tag for tree in found if tree.tag]
    twice = sorted({tag for tag in tags if tags.count(tag) > 1})
    if twice:
        raise InventoryError(f"{path}: tag {twice[0]} is given to more than one tree")
    return FieldList(found, frame)


def _tree(where: str, row: Mapping[str, str], frame: Frame) -> FieldTree:
    first, second = PLACES[frame]
    try:
        a, b, dbh = float(row[first]), float(row[second]), float(row["dbh_cm"])
    except ValueError as error:
        raise InventoryError(f"{where}: {first}, {second} and dbh_cm are numbers ({error})") from error
    if not np.isfinite([a, b]).all():
        raise InventoryError(f"{where}: {first} {a:g} and {second} {b:g} are no place")
    if not LEAST_CM <= dbh <= MOST_CM:
        raise InventoryError(f"{where}: a diameter of {dbh:g} cm; they are in centimetres")
    if frame == "degrees" and not (abs(a) <= 180.0 and abs(b) <= 90.0):
        raise InventoryError(f"{where}: longitude {a:g} and latitude {b:g}; they are in degrees")
    if frame == "plot":
        if b < 0.0:
            raise InventoryError(f"{where}: a distance of {b:g} m")
        azimuth = np.radians(a)
        a, b = float(b * np.sin(azimuth)), float(b * np.cos(azimuth))
    return FieldTree(a, b, dbh / 100.0, row.get("tag", ""), row.get("species", ""))
