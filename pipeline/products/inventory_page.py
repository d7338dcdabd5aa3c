"""A page a plot: where the trees stand, their diameters, and each stem's slice as a picture; and one over many."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.inventory.trees import ListedTree, RejectedTree
from pipeline.products import sheet
from pipeline.products.plots import Dots, Plot

Corner = npt.NDArray[np.float64]
PICTURE_PX = 96
_NONE = "-"
_MAP = "Seen from above, y upwards. Numbers are those of trees.csv; rejected places in grey."
_WHOLE = "Seen from above, y upwards; rejected places in grey. Numbers and slices are on the pages of the squares."
TARGET = 0.5
"""Probability from which a tree is shown as of the detected species."""


def write_plot_page(
    path: Path,
    title: str,
    trees: Sequence[ListedTree],
    rejected: Sequence[RejectedTree],
    notes: Sequence[str],
) -> None:
    """Readable offline, without trees too."""
    parts = [sheet.facts(_facts(trees, rejected))]
    parts += [sheet.notes(notes)] if notes else []
    parts.append(sheet.figure("Stems", _map(trees, rejected), _MAP))
    if trees:
        parts.append(sheet.figure("Diameters", _diameters(trees)))
        parts.append(sheet.section("Slices"))
        parts.append(sheet.words("Points about breast height from above, and the circle that the table tells of."))
        head = ("", "Tree", "DBH cm", "Height m", "Quality", "Arc", "Species", "Status")
        parts.append(sheet.table(head, [_row(tree) for tree in trees]))
    path.write_text(sheet.sheet(title, parts), encoding="utf-8")


def write_overview_page(
    path: Path,
    trees: Sequence[ListedTree],
    rejected: Sequence[RejectedTree],
    notes: Sequence[str],
    squares: Sequence[tuple[str, str, Sequence[ListedTree]]],
) -> None:
    """squares: link, name and trees of each page that shows the slices."""
    parts = [sheet.facts(_facts(trees, rejected))]
    parts += [sheet.notes(notes)] if notes else []
    parts.append(sheet.figure("Stems", _map(trees, rejected, numbered=False), _WHOLE))
    parts.append(sheet.figure("Diameters", _diameters(trees)))
    parts.append(sheet.section("Squares"))
    head = ("", "Trees", "Mean DBH", "Quadratic mean DBH", "Basal area", "Mean height")
    rows = [[f'<a href="{link}">{sheet.text(name)}</a>', *_figures(mine)] for link, name, mine in squares]
    parts.append(sheet.table(head, rows))
    path.write_text(sheet.sheet("Inventory", parts), encoding="utf-8")


def _figures(trees: Sequence[ListedTree]) -> list[str]:
    facts = _facts(trees, ())
    return [facts[name] for name in ("Trees", "Mean DBH", "Quadratic mean DBH", "Basal area", "Mean height")]


def _facts(trees: Sequence[ListedTree], rejected: Sequence[RejectedTree]) -> dict[str, str]:
    dbh = np.array([tree.dbh_m for tree in trees])
    height = np.array([tree.height_m for tree in trees])
    height = height[np.isfinite(height)]
    return {
        "Trees": str(len(trees)),
        "Rejected": str(len(rejected)),
        "Mean DBH": f"{100 * dbh.mean():.1f} cm" if len(dbh) else _NONE,
        "Quadratic mean DBH": f"{100 * np.sqrt((dbh**2).mean()):.1f} cm" if len(dbh) else _NONE,
        "Basal area": f"{np.pi / 4 * (dbh**2).sum():.2f} m²" if len(dbh) else _NONE,
        "Mean height": f"{height.mean():.1f} m" if len(height) else _NONE,
    }


def _map(trees: Sequence[ListedTree], rejected: Sequence[RejectedTree], *, numbered: bool = True) -> Plot:
    """From a whole corner: seven digits of a grid leave no room for the plot."""
    places = np.array([*(tree.position_m[:2] for tree in trees), *(one.position_m[:2] for one in rejected)])
    corner = np.floor(places.reshape(-1, 2).min(axis=0, initial=np.inf) / 10.0) * 10.0
    corner = np.where(np.isfinite(corner), corner, 0.0)
    target = [tree.probability > TARGET for tree in trees]
    off = np.array([one.position_m[:2] for one in rejected]).reshape(-1, 2) - corner
    some = [Dots(off[:, 0], off[:, 1], "rejected", "s", each=True)]
    for name, tone, meant in (("trees", "a", False), ("detected species", "t", True)):
        if mine := [tree for tree, is_target in zip(trees, target, strict=True) if is_target == meant]:
            some.append(_dots(mine, corner, name, tone, numbered=numbered))
    east, north = (f"{value:,.0f}".replace(",", " ") for value in corner.tolist())
    return Plot(f"x m from {east}", f"y m from {north}", dots=some, equal=True)


def _dots(trees: Sequence[ListedTree], corner: Corner, name: str, tone: str, *, numbered: bool) -> Dots:
    at = np.array([tree.position_m[:2] for tree in trees]) - corner
    return Dots(at[:, 0], at[:, 1], name, tone, [str(tree.tree_id) for tree in trees] if numbered else (), each=True)


def _diameters(trees: Sequence[ListedTree]) -> Plot:
    dbh = np.array([100 * tree.dbh_m for tree in trees])
    height = np.array([tree.height_m for tree in trees])
    return Plot("DBH cm", "height m", dots=[Dots(dbh, height, "trees", "a")], from_zero=True)


def _row(tree: ListedTree) -> list[str]:
    stem = tree.stem
    sigma = f" ± {100 * tree.dbh_sigma_m:.1f}" if np.isfinite(tree.dbh_sigma_m) else ""
    species = f"{tree.species} {tree.probability:.0%}" if np.isfinite(tree.probability) else tree.species
    return [
        slice_picture(tree),
        str(tree.tree_id) + (f" ({sheet.text(tree.tag)})" if tree.tag else ""),
        f"{100 * tree.dbh_m:.1f}{sigma}",
        f"{tree.height_m:.1f}" if np.isfinite(tree.height_m) else _NONE,
        f"{stem.quality:.2f}" if stem else _NONE,
        f"{stem.arc_deg:.0f}°" if stem else _NONE,
        sheet.text(species or _NONE),
        sheet.text(tree.status),
    ]


def slice_picture(tree: ListedTree) -> str:
    """The points of a slice and its circle, as SVG; empty without points."""
    if tree.stem is None or not len(tree.stem.shown_m):
        return ""
    reach = max(0.5 * tree.dbh_m * 1.25, float(np.abs(tree.stem.shown_m).max()) * 1.05, 0.05)
    half = PICTURE_PX / 2
    scale = half / reach
    marks = "".join(f"M{half + x * scale:.1f} {half - y * scale:.1f}h0" for x, y in tree.stem.shown_m.tolist())
    return (
        f'<svg style="width:{PICTURE_PX}px" viewBox="0 0 {PICTURE_PX} {PICTURE_PX}" role="img" '
        f'aria-label="slice of tree {tree.tree_id}"><path class="dots s" style="stroke-width:1.6" d="{marks}"/>'
        f'<circle class="line b" cx="{half}" cy="{half}" r="{0.5 * tree.dbh_m * scale:.1f}"/></svg>'
    )
