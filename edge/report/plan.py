"""The session from above, and its trees."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from edge.recording.folder import SessionRecord
from edge.report.made import Made
from pipeline.gnss.geodesy import Datum
from pipeline.products import sheet
from pipeline.products.chips import smaller
from pipeline.products.occurrences import DEMONSTRATION
from pipeline.products.page import fix_dots
from pipeline.products.plots import Dots, Line, Picture, Plot
from pipeline.products.relief import relief

Array = npt.NDArray[np.float64]
_MARGIN_M = 6.0
_CHIP_PX = 320
_CHIPS = 150
"""Pictures of so many trees, the most probable: 20 kB each."""
_RELIEF = "relief"
_HEAD = ("", "tree", "place", "known to", "beside the way", "size", "seen", "remarks")


def plan_parts(made: Made | None, record: SessionRecord | None) -> Iterator[str]:
    """Drawn on the shaded ground of the map."""
    if made is None:
        return
    yield sheet.section("From above")
    way, trees = made.plan(made.poses.positions_m), made.plan_of_trees()
    ground = relief(made.cloud, _bounds(np.vstack([way, trees, *made.searched])))
    picture = None
    if ground is not None:
        picture = Picture(_RELIEF, ground.west, ground.east, ground.south, ground.north)
        yield sheet.picture(_RELIEF, ground.png)
    axes = ("east on the grid, m", "north on the grid, m") if made.placed is not None else ("x, m", "y, m")
    lines = [Line(way[:, 0], way[:, 1], "way")]
    lines += [Line(ring[:, 0], ring[:, 1], "" if k else "searched", "s") for k, ring in enumerate(made.searched)]
    dots = [*_fixes(made), *_marks(made, record)]
    if len(trees):
        numbers = [str(tree["tree_id"]) for tree in made.trees]
        dots.append(Dots(trees[:, 0], trees[:, 1], "trees", "t", numbers))
    yield sheet.figure("", Plot(*axes, lines, dots, picture=picture, equal=True), _caption(made, ground is not None))


def tree_parts(made: Made | None) -> Iterator[str]:
    """A row a tree, the most probable first."""
    yield sheet.section("Trees")
    if made is None or made.facts.findings is None:
        yield sheet.words("No detector looked at the images of this session: there is nothing to say about trees.")
        return
    found = made.facts.findings
    yield sheet.words(
        f"{found.model} looked at {found.images:,} images and found {found.trees} trees in {found.patches} patches, "
        f"{found.infested_m2:,.0f} m² below their crowns, in {found.searched_m2:,.0f} m² searched. {found.warning}"
    )
    if not made.trees:
        yield sheet.words("Nothing was found: what was searched, and only that, may be taken for free of the tree.")
        return
    ranked = sorted(made.trees, key=lambda tree: -tree["probability"])
    yield sheet.table(_HEAD, [_row(made, tree, pictured=k < _CHIPS) for k, tree in enumerate(ranked)])
    if len(ranked) > _CHIPS:
        yield sheet.words(f"Pictures of all the trees are in {made.folder.name}/DCIM.")


def _caption(made: Made, shaded: bool) -> str:
    ground = "Ground shaded, stems and undergrowth dark, from the LiDAR map." if shaded else "There is no map to draw."
    if made.placed is None:
        return f"{ground} Local metres from the start of the session; the heading is arbitrary."
    told = made.facts.georeference
    assert told is not None
    return (
        f"{ground} Metres from {told.latitude_deg:.6f}, {told.longitude_deg:.6f} in EPSG:{told.epsg}; grid north "
        f"bears {told.convergence_deg:+.2f}° from true north; {told.heights}."
    )


def _bounds(places: Array) -> tuple[float, float, float, float]:
    (west, south), (east, north) = places.min(axis=0) - _MARGIN_M, places.max(axis=0) + _MARGIN_M
    return float(west), float(south), float(east), float(north)


def _fixes(made: Made) -> list[Dots]:
    if made.facts.datum is None or not made.fixes or made.placed is None:
        return []
    datum = Datum(*made.facts.datum)
    enu = np.array([datum.enu(fix.latitude_deg, fix.longitude_deg, fix.height_m) for fix in made.fixes])
    known = np.isfinite(enu).all(axis=1)
    plan = np.full((len(enu), 2), np.nan)
    plan[known] = made.plan(enu[known])
    return fix_dots(made.fixes, plan)


def _marks(made: Made, record: SessionRecord | None) -> list[Dots]:
    if record is None or not record.marks:
        return []
    way = made.plan(made.poses.positions_m)
    nearest = [int(np.argmin(np.abs(made.poses.stamps_ns - mark.stamp_ns))) for mark in record.marks]
    return [Dots(way[nearest, 0], way[nearest, 1], "marks", "a", [mark.text[:24] for mark in record.marks])]


def _row(made: Made, tree: dict[str, Any], *, pictured: bool) -> tuple[str, ...]:
    picture = made.folder / tree["crop"] if tree["crop"] and pictured else None
    photo = ""
    if picture is not None and picture.exists():
        photo = sheet.photo(smaller(picture, _CHIP_PX), f"tree {tree['tree_id']}")
    name = tree["scientific_name"] or tree["common_name"]
    return (
        photo,
        sheet.text(f"{tree['tree_id']}: {name}, {tree['probability']:.0%}"),
        _place(tree),
        f"{tree['coordinate_uncertainty_m']:.1f} m (95 %)",
        f"{tree['from_track_m']:.1f} m, {tree['along_track_m']:.0f} m after its start",
        _size(tree),
        f"recognised in {tree['n_hits']} of {tree['n_views']} images",
        sheet.text(_remarks(tree)),
    )


def _remarks(tree: dict[str, Any]) -> str:
    """Without what has been said above; a person may have emptied the fields."""
    said = (tree["verification_status"] or "", *(tree["comments"] or "").split("; "))
    return "; ".join(part for part in said if part not in ("", DEMONSTRATION))


def _place(tree: dict[str, Any]) -> str:
    if "latitude" not in tree:
        return f"x {tree['x_m']:.1f} m, y {tree['y_m']:.1f} m"
    at = f"{tree['latitude']:.6f},{tree['longitude']:.6f}"
    return f'<a href="geo:{at}">{at.replace(",", ", ")}</a>'


def _size(tree: dict[str, Any]) -> str:
    known = [(tree["height_m"], "m high"), (tree["crown_m"], "m crown")]
    return ", ".join(f"{value:.1f} {words}" for value, words in known if np.isfinite(value)) or "not seen"
