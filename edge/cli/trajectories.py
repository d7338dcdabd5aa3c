"""Trajectories beside the truth, and beside each other, for people."""

from __future__ import annotations

from math import isfinite

from rich.console import Console
from rich.table import Table

from edge.process.against_truth import APART
from pipeline.evaluation.pair import Compared

HONEST_SHARE = 0.95
"""Of the differences, within the 95 % ellipsoid of both covariances together."""


def show(out: Console, found: list[Compared]) -> None:
    """The table, and a line on live and offline where there are both."""
    out.print(trajectory_table(found))
    if apart := agreement(found):
        out.print(apart, highlight=False)


def trajectory_table(found: list[Compared]) -> Table:
    """A row a trajectory and alignment."""
    rows = [one for one in found if one.trajectory != APART]
    first = rows[0].errors
    title = f"trajectory: {first.poses:,} poses over {first.length_m:,.1f} m; APE, and RPE over {first.rpe_over_m:g} m"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    # What fits 80 columns; --json has the rest.
    columns = ("rmse m", "worst", "across", "up", "deg", "RPE m", "end m", "drift%", "NEES", "in 95%")
    for column in ("frame", "fit", *columns):
        table.add_column(column, justify="left" if column in {"frame", "fit"} else "right", no_wrap=True)
    for one in rows:
        e = one.errors
        metres = (e.ape_m.rmse, e.ape_m.worst, e.ape_horizontal_m.rmse, e.ape_vertical_m.rmse)
        figures = [*(f"{value:.3f}" for value in metres), f"{e.ape_deg.rmse:.2f}", f"{e.rpe_m.rmse:.3f}"]
        figures += [f"{e.end_m:.3f}", f"{e.drift_percent:.2f}"]
        figures += [f"{e.nees:.2f}", f"{e.within_95:.0%}"] if isfinite(e.nees) else ["", ""]
        table.add_row(one.trajectory, e.alignment, *(figure.replace("nan", "-") for figure in figures))
    return table


def agreement(found: list[Compared]) -> str:
    """How far live and offline are apart, and whether their covariances allow for it; empty without both."""
    errors = next((one.errors for one in found if one.trajectory == APART), None)
    if errors is None:
        return ""
    apart = f"live - offline: {errors.ape_m.rmse:.3f} m rms, {errors.ape_m.worst:.3f} m worst"
    if not isfinite(errors.within_95):
        return apart
    verdict = "agree" if errors.within_95 >= HONEST_SHARE else "disagree"
    return f"{apart}, {errors.within_95:.0%} in the 95 % ellipsoid: {verdict}"
