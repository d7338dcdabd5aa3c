"""Mapped trees beside those that are there, for people."""

from __future__ import annotations

from math import isfinite

from rich.console import Console
from rich.table import Table

from edge.process.trees_against_truth import SEEN_S, WITHIN_M, ComparedTrees
from pipeline.evaluation.trees import TreeErrors


def show(out: Console, found: ComparedTrees) -> None:
    """A row for the map as it is handed out, one with the error of the trajectory taken off."""
    title = f"trees within {WITHIN_M:.0f} m of the way that were seen for {SEEN_S:.0f} s; places in plan"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    columns = ("found", "recall", "right", "precision", "median m", "worst m", "in 95%")
    for column in ("", *columns):
        table.add_column(column, justify="right" if column else "left", no_wrap=True)
    if found.on_the_earth is not None:
        table.add_row("on the Earth", *_figures(found.on_the_earth))
    table.add_row("beside the way", *_figures(found.beside_the_way))
    out.print(table)


def _figures(errors: TreeErrors) -> tuple[str, ...]:
    return (
        f"{errors.found} of {errors.true}",
        _share(errors.recall),
        f"{errors.right} of {errors.mapped}",
        _share(errors.precision),
        _metres(errors.error_median_m),
        _metres(errors.error_worst_m),
        _share(errors.within_95),
    )


def _share(value: float) -> str:
    return f"{value:.0%}" if isfinite(value) else "-"


def _metres(value: float) -> str:
    return f"{value:.2f}" if isfinite(value) else "-"
