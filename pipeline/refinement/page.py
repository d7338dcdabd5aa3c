"""The graph as a page, readable offline: the way, closures, residuals, GNSS, and lines to correct it with."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.estimates import Array
from pipeline.products import sheet
from pipeline.products.page import TIME
from pipeline.products.plots import Dots, Line, Plot
from pipeline.refinement.closing import Verdict
from pipeline.refinement.refine import Refined
from pipeline.refinement.table import HEADER, rows

_OFFERED = 12
"""Stretches of GNSS that a line is offered for."""
_AROUND_S = 0.5
"""Added to both ends of a stretch."""
_ROUNDING_S = 0.1
_TOGETHER_S = 5.0
"""Fixes rejected within this time are one stretch."""


def write_page(path: Path, found: Refined) -> None:
    """Write it."""
    parts = [sheet.facts(_facts(found)), sheet.figure("Way and closures from above", way(found), _WAY)]
    parts += [sheet.figure(title, plot) for title, plot in residuals(found)]
    parts.append(sheet.figures("Closures", HEADER, [*rows(found)], _CLOSURES))
    if lines := "\n".join(_lines(found)):
        parts += [sheet.subtitle("Lines for constraints.toml"), sheet.words(_LINES), sheet.code(lines)]
    parts.append(sheet.notes([*found.notes, _PINS]))
    path.write_text(sheet.sheet("Refinement", parts), encoding="utf-8")


_WAY = "Lines across join places that were recognised; in the third colour those that were not believed."
_CLOSURES = "Every pair of places that the trajectory brings near each other; times are seconds since the first pose."
_LINES = "Copy those that you know better into constraints.toml beside this page, and refine again."
_PINS = (
    "A surveyed point: [[pin]] with at_s, latitude_deg, longitude_deg, height_m (above the ellipsoid), sigma_m, and "
    "arm_m where it was not the IMU that touched it. docs/refinement.md has all keys."
)


def way(found: Refined) -> Plot:
    """Refined and open, fixes used and left out, closures."""
    solved, before = found.solution, found.open
    lines = [
        Line(before.poses.positions_m[:, 0], before.poses.positions_m[:, 1], "without closures", "s"),
        Line(solved.poses.positions_m[:, 0], solved.poses.positions_m[:, 1], "refined"),
    ]
    for name, tone, which in (("closures", "b", True), ("not believed", "c", False)):
        x, y = _across(solved.poses.positions_m, [one for one in found.verdicts if one.sound == which])
        lines += [Line(x, y, name, tone)] if len(x) else []
    dots = []
    if solved.fixes is not None and solved.judged is not None:
        places, used = solved.fixes.position_m, solved.judged.used
        named = (("GNSS used", "a", used), ("GNSS left out", "b", ~used))
        dots = [Dots(places[which, 0], places[which, 1], name, tone) for name, tone, which in named if which.any()]
    axes = ("x, m", "y, m") if solved.datum is None else ("east, m", "north, m")
    return Plot(*axes, lines, dots, equal=True)


def residuals(found: Refined) -> Iterator[tuple[str, Plot]]:
    """Of fixes and of the odometry, over time."""
    solved = found.solution
    stamps = solved.frames.stamps_ns
    if solved.fixes is not None and solved.judged is not None:
        at, off = (solved.fixes.stamps_ns - stamps[0]) / 1e9, solved.residuals_m
        horizontal, used = np.linalg.norm(off[:, :2], axis=1), solved.judged.used
        named = (("used", "a", used), ("left out", "b", ~used))
        dots = [Dots(at[which], horizontal[which], name, tone) for name, tone, which in named if which.any()]
        yield "GNSS: horizontal residual, m", Plot(TIME, "residual", dots=dots, from_zero=True)
    moved = solved.poses.positions_m - found.open.poses.positions_m
    seconds = (stamps - stamps[0]) / 1e9
    sizes = [
        Line(seconds, np.linalg.norm(moved[:, :2], axis=1), "horizontal"),
        Line(seconds, np.abs(moved[:, 2]), "vertical", "c"),
    ]
    yield "What the closures moved, m", Plot(TIME, "moved", sizes, from_zero=True, height=150)
    yield (
        "Odometry: residual of each step, sigmas",
        Plot(TIME, "sigmas", [Line(seconds[1:], steps(found), "")], from_zero=True),
    )


def steps(found: Refined) -> Array:
    """(m - 1,) by how many of its own sigmas each step of the odometry was bent, in position."""
    frames, poses = found.solution.frames, found.solution.poses
    said = np.einsum("kji,kj->ki", frames.rotations[:-1], np.diff(frames.positions_m, axis=0))
    held = np.einsum("kji,kj->ki", poses.rotations[:-1], np.diff(poses.positions_m, axis=0))
    return np.asarray(np.linalg.norm(held - said, axis=1) / np.sqrt(frames.drifted[:, 1:].sum(axis=1)))


def rejected_stretches(found: Refined) -> Iterator[tuple[float, float, int]]:
    """(from, to, number of fixes), seconds since the first pose, the largest first."""
    solved = found.solution
    if solved.fixes is None or solved.judged is None:
        return
    seconds = (solved.fixes.stamps_ns[~solved.judged.used] - solved.frames.stamps_ns[0]) / 1e9
    groups = np.split(seconds, np.flatnonzero(np.diff(seconds) > _TOGETHER_S) + 1)
    for group in sorted((group for group in groups if len(group)), key=len, reverse=True):
        yield float(group[0]), float(group[-1]), len(group)


def _lines(found: Refined) -> Iterator[str]:
    for one, row in zip(found.verdicts, rows(found), strict=True):
        word, why = ("forbid", f"overlap {row[6]}") if one.sound else ("accept", row[3])
        if one.registered is not None:
            yield f"[[{word}]]  # {why}\na_s = {row[0]}\nb_s = {row[1]}\n"
    for from_s, to_s, count in [*rejected_stretches(found)][:_OFFERED]:
        begin, end = max(from_s - _AROUND_S, 0.0), min(to_s + _AROUND_S, found.problem.duration_s - _ROUNDING_S)
        yield f"[[drop_gnss]]  # {count} fixes are left out\nfrom_s = {begin:.1f}\nto_s = {end:.1f}\n"


def _across(positions_m: Array, verdicts: list[Verdict]) -> tuple[Array, Array]:
    gap = np.full(2, np.nan)
    ends = [np.array([*positions_m[list(one.keys), :2], gap]) for one in verdicts]
    joined = np.concatenate(ends) if ends else np.empty((0, 2))
    return joined[:, 0], joined[:, 1]


def _facts(found: Refined) -> dict[str, str]:
    solved = found.solution
    shown = {
        "travelled": f"{solved.frames.travelled_m[-1]:,.0f} m",
        "keyframes": f"{len(solved.frames):,}",
        "odometry's sigmas": f"times {solved.drift_scale:g}",
        "closures believed": f"{len(solved.closures)} of {len(found.verdicts)}",
    }
    if solved.fixes is not None and solved.judged is not None:
        shown["fixes used"] = f"{int(solved.judged.used.sum())} of {len(solved.fixes)}"
        shown["GNSS sigmas"] = "times " + ", ".join(f"{scale:.1f}" for scale in solved.judged.scale.tolist())
    return shown
