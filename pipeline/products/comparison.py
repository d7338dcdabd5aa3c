"""One page about how far trajectories are from the truth, and whether they know it, readable offline."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pipeline.evaluation.pair import Pair
from pipeline.evaluation.series import DEGREES, Series, bounds, calibration, error_series, stretch_errors
from pipeline.evaluation.trajectory import Array, trajectory_errors
from pipeline.products import sheet
from pipeline.products.plots import Line, Plot

TIME = "seconds since the first pose"
SIGMAS = 3.0
_LAID = {
    "none": "as it is.",
    "yaw": "laid over it by its heading. Its covariance counts from the start, and is not of what is left then.",
    "se3": "laid over it in all axes.",
}


def write_comparison(path: Path, title: str, pairs: Sequence[Pair]) -> None:
    """A section a pair, each in the first of its alignments."""
    parts = [part for pair in pairs for part in _section(pair)]
    path.write_text(sheet.sheet(title, parts), encoding="utf-8")


def _section(pair: Pair) -> Iterator[str]:
    kind = pair.alignments[0]
    series = error_series(pair.estimate, pair.true, kind)
    yield sheet.section(pair.name)
    yield sheet.words(f"Against the {pair.against}, {_LAID[kind]}")
    yield sheet.facts(_facts(pair))
    yield sheet.figure("Both ways from above", _ways(series, pair))
    stated = series.across_sigma_m is not None
    yield sheet.figure(f"Horizontal error{_bound(stated)}, m", _across(series))
    yield sheet.figure(f"Vertical error{_bound(stated)}, m", _up(series))
    yield from _stretches(series)
    if series.squared is not None:
        yield from _honesty(series.squared, series.seconds)


def _facts(pair: Pair) -> dict[str, str]:
    errors = trajectory_errors(pair.estimate, pair.true, pair.alignments[0])
    shown = {
        "poses": f"{errors.poses:,}",
        "way": f"{errors.length_m:,.1f} m",
        "rms": f"{errors.ape_m.rmse:.3f} m",
        "worst": f"{errors.ape_m.worst:.3f} m",
        "horizontal rms": f"{errors.ape_horizontal_m.rmse:.3f} m",
        "vertical rms": f"{errors.ape_vertical_m.rmse:.3f} m",
        "attitude rms": f"{errors.ape_deg.rmse:.2f}°",
    }
    if np.isfinite(errors.nees):
        shown |= {"normalised error": f"{errors.nees:.2f}", "within the 95 % ellipsoid": f"{errors.within_95:.0%}"}
    return shown


def _bound(stated: bool) -> str:
    return f" and {SIGMAS:g} sigmas of the stated covariance" if stated else ""


def _ways(series: Series, pair: Pair) -> Plot:
    ways = ((series.true, pair.against, "c"), (series.estimate, "estimate", "a"))
    lines = [Line(way.positions_m[:, 0], way.positions_m[:, 1], name, tone) for way, name, tone in ways]
    return Plot("east, m", "north, m", lines, equal=True)


def _across(series: Series) -> Plot:
    lines = [Line(series.seconds, series.across_m, "error")]
    if series.across_sigma_m is not None:
        lines.append(Line(series.seconds, SIGMAS * series.across_sigma_m, f"{SIGMAS:g} sigmas", "b"))
    return Plot(TIME, "horizontal error", lines, from_zero=True)


def _up(series: Series) -> Plot:
    lines = [Line(series.seconds, series.up_m, "error")]
    if series.up_sigma_m is not None:
        bound = SIGMAS * series.up_sigma_m
        lines += [Line(series.seconds, bound, f"{SIGMAS:g} sigmas", "b"), Line(series.seconds, -bound, "", "b")]
    return Plot(TIME, "vertical error", lines)


def _stretches(series: Series) -> Iterator[str]:
    found = stretch_errors(series.estimate, series.true)
    if not found:
        return
    at = np.arange(len(found), dtype=np.float64)
    names = [f"{one.length_m:g} m" for one in found]
    values = {
        "worst": ("b", [one.metres.worst for one in found]),
        "rms": ("a", [one.metres.rmse for one in found]),
        "median": ("c", [one.metres.median for one in found]),
    }
    lines = [Line(at, np.array(errors), name, tone) for name, (tone, errors) in values.items()]
    plot = Plot("length of the stretch", "relative error", lines, x_names=names, from_zero=True)
    yield sheet.figure("Relative error over stretches of the way (RPE), m", plot)


def _honesty(squared: Array, seconds: Array) -> Iterator[str]:
    low, high = (bound / DEGREES for bound in bounds())
    ends = seconds[[0, -1]]
    lines = [
        Line(seconds, squared / DEGREES, "normalised error"),
        Line(ends, np.full(2, high), f"95 % between {low:.2f} and {high:.2f}", "b"),
        Line(ends, np.full(2, low), "", "b"),
    ]
    yield sheet.figure(
        "Normalised squared error over time (NEES / 3)",
        Plot(TIME, "normalised error", lines, from_zero=True),
        "1 is expected of an honest covariance, more says that it is too small. Errors last for many poses: a whole "
        "walk above or below is one draw, not hundreds.",
    )
    expected, found = calibration(squared)
    lines = [Line(expected, expected, "expected", "c"), Line(expected, found, "found")]
    yield sheet.figure(
        "Share of normalised errors within each quantile of chi-square",
        Plot("share expected", "share found", lines, from_zero=True),
        "Above the diagonal the covariance is larger than the errors, below it is too small.",
    )
