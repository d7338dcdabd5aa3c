"""The pages of an inventory: one, or one over all and one for each square where there are many trees."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from edge.process.product_facts import whole
from pipeline.inventory.trees import ListedTree, RejectedTree, TreeList
from pipeline.products.inventory_page import write_overview_page, write_plot_page

PAGE, SQUARES = "plot.html", "squares"
SQUARE_M = 50.0
MOST_ON_A_PAGE = 400
"""Trees; a megabyte."""


def write_pages(folder: Path, given: TreeList, notes: Sequence[str]) -> str:
    """What `plot.html` is. Pages of squares that an earlier run made do not stay behind."""
    shutil.rmtree(folder / SQUARES, ignore_errors=True)
    if len(given.trees) <= MOST_ON_A_PAGE:
        with whole(folder / PAGE) as path:
            write_plot_page(path, "Inventory", given.trees, given.rejected, notes)
        return "stem map, diameters, slices"
    (folder / SQUARES).mkdir()
    listed = []
    for (x, y), mine in sorted(_by_square(given).items()):
        link = f"{SQUARES}/{x}_{y}.html"
        with whole(folder / link) as path:
            write_plot_page(path, f"Inventory of the {SQUARE_M:g} m square from {x} {y}", mine.trees, mine.rejected, ())
        listed.append((link, f"{x} {y}", mine.trees))
    with whole(folder / PAGE) as path:
        write_overview_page(path, given.trees, given.rejected, notes, listed)
    return f"stem map; slices on a page for each of {len(listed)} squares"


def _by_square(given: TreeList) -> dict[tuple[int, int], TreeList]:
    """Those with trees, by their lowest corners."""
    squares: dict[tuple[int, int], TreeList] = {}
    for tree in given.trees:
        squares.setdefault(_square(tree), TreeList([], [])).trees.append(tree)
    for one in given.rejected:
        if (square := _square(one)) in squares:
            squares[square].rejected.append(one)
    return squares


def _square(one: ListedTree | RejectedTree) -> tuple[int, int]:
    x, y = (int(np.floor(float(value) / SQUARE_M) * SQUARE_M) for value in one.position_m[:2])
    return x, y
