"""The graph as a page, readable offline: the way, closures, residuals, GNSS, and lines to correct it with."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pipeline.estimates import Array
from pipeline.products import sheet
from pipeline.products.page import TIME
from pipeline.products.plots import Dots, Line, Plot
from pipeline.refinement.closing import Verdict
from pipeline.refinement.fixes import KIND_NAMES
from pipeline.refinement.refine import Refined
from pipeline.refinement.solver import Solution
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
    parts.append(
        sheet.figures("Closures", _shown(HEADER, found), [_shown(row, found) for row in rows(found)], _CLOSURES)
    )
    if lines := "\n".join(_lines(found)):
        parts += [sheet.subtitle("Lines for constraints.toml"), sheet.words(_LINES), sheet.code(lines)]
    parts.append(sheet.notes([*found.notes, _PINS]))
    path.write_text(sheet.sheet("Refinement", parts), encoding="utf-8")


_WAY = "Lines across join places that were recognised; in the third colour those that were not believed."
_CLOSURES = (
    "Every pair of places that the trajectory brings near each other, or that were known again by their stems; times "
    "are seconds since the first pose."
)
_LINES = "Copy those that you know better into constraints.toml beside this page, and refine again."
_PINS = (
    "A surveyed point: [[pin]] with at_s, latitude_deg, longitude_deg, height_m (above the ellipsoid), sigma_m, and "
    "arm_m where it was not the IMU that touched it. docs/refinement.md has all keys."
)


def way(found: Refined) -> Plot:
    """Refined and open, fixes used and left out, closures."""
    solved, before, names = found.solution, found.open, found.problem.names
    lines = []
    for number, name in enumerate(names):
        mine = solved.frames.session == number
        of = f" {name}" if len(names) > 1 else ""
        for poses, said, tone in ((before.poses, "without closures", "s"), (solved.poses, "refined", "a")):
            x, y, _ = poses.positions_m[mine].T
            lines.append(Line(x, y, said + of, tone))
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
    """Of fixes and of the odometry, over the time of each session."""
    solved = found.solution
    for number, name in enumerate(found.problem.names):
        of = f"{name}: " if len(found.problem.names) > 1 else ""
        mine = solved.frames.session == number
        if solved.fixes is not None and solved.judged is not None:
            here = solved.fixes.of(number, solved.frames)
            at, used = solved.fixes.seconds(solved.frames), solved.judged.used
            horizontal = np.linalg.norm(solved.residuals_m[:, :2], axis=1)
            named = (("used", "a", used & here), ("left out", "b", ~used & here))
            dots = [Dots(at[which], horizontal[which], said, tone) for said, tone, which in named if which.any()]
            if dots:
                yield f"{of}GNSS: horizontal residual, m", Plot(TIME, "residual", dots=dots, from_zero=True)
        moved = (solved.poses.positions_m - found.open.poses.positions_m)[mine]
        seconds = solved.frames.seconds[mine]
        sizes = [
            Line(seconds, np.linalg.norm(moved[:, :2], axis=1), "horizontal"),
            Line(seconds, np.abs(moved[:, 2]), "vertical", "c"),
        ]
        yield f"{of}What the closures moved, m", Plot(TIME, "moved", sizes, from_zero=True, height=150)
        bent = [Line(seconds[1:], steps(solved.of(number)), "")]
        yield f"{of}Odometry: residual of each step, sigmas", Plot(TIME, "sigmas", bent, from_zero=True)


def steps(solved: Solution) -> Array:
    """(m - 1,) of one session: by how many of its own sigmas each step of the odometry was bent, in position."""
    frames, poses = solved.frames, solved.poses
    said = np.einsum("kji,kj->ki", frames.rotations[:-1], np.diff(frames.positions_m, axis=0))
    held = np.einsum("kji,kj->ki", poses.rotations[:-1], np.diff(poses.positions_m, axis=0))
    return np.asarray(np.linalg.norm(held - said, axis=1) / np.sqrt(frames.drifted[1:, 1:].sum(axis=1)))


def rejected_stretches(found: Refined) -> list[tuple[int, float, float, int]]:
    """(session, from, to, number of fixes), seconds since its first pose, the largest first."""
    solved, groups = found.solution, []
    if solved.fixes is None or solved.judged is None:
        return []
    for number in range(len(found.problem.names)):
        out = solved.fixes.of(number, solved.frames) & ~solved.judged.used
        seconds = solved.fixes.seconds(solved.frames)[out]
        parts = np.split(seconds, np.flatnonzero(np.diff(seconds) > _TOGETHER_S) + 1)
        groups += [(number, float(part[0]), float(part[-1]), len(part)) for part in parts if len(part)]
    return sorted(groups, key=lambda group: group[3], reverse=True)


def _lines(found: Refined) -> Iterator[str]:
    names = found.problem.names
    for one, row in zip(found.verdicts, rows(found), strict=True):
        cell = dict(zip(HEADER, row, strict=True))
        word, why = ("forbid", f"overlap {cell['overlap']}") if one.sound else ("accept", cell["reason"])
        if one.registered is not None:
            ends = f"a = {_quoted(cell['a'])}\nb = {_quoted(cell['b'])}\n" if len(names) > 1 else ""
            yield f"[[{word}]]  # {why}\n{ends}a_s = {cell['a_s']}\nb_s = {cell['b_s']}\n"
    for number, from_s, to_s, count in rejected_stretches(found)[:_OFFERED]:
        last_s = found.problem.sessions[number].duration_s - _ROUNDING_S
        begin, end = max(from_s - _AROUND_S, 0.0), min(to_s + _AROUND_S, last_s)
        of = f"session = {_quoted(names[number])}\n" if len(names) > 1 else ""
        yield f"[[drop_gnss]]  # {count} fixes are left out\n{of}from_s = {begin:.1f}\nto_s = {end:.1f}\n"


def _shown(row: Sequence[str], found: Refined) -> list[str]:
    """Without the names of the sessions where there is one."""
    names = (HEADER.index("a"), HEADER.index("b")) if len(found.problem.names) == 1 else ()
    return [cell for k, cell in enumerate(row) if k not in names]


def _quoted(name: str) -> str:
    """As a string in TOML, which JSON's are."""
    return json.dumps(name)


def _across(positions_m: Array, verdicts: list[Verdict]) -> tuple[Array, Array]:
    gap = np.full(2, np.nan)
    ends = [np.array([*positions_m[list(one.keys), :2], gap]) for one in verdicts]
    joined = np.concatenate(ends) if ends else np.empty((0, 2))
    return joined[:, 0], joined[:, 1]


def _facts(found: Refined) -> dict[str, str]:
    solved, names = found.solution, found.problem.names
    ends = np.append(solved.frames.begins[1:], len(solved.frames)) - 1
    shown = {"sessions": ", ".join(names)} if len(names) > 1 else {}
    shown |= {
        "travelled": f"{solved.frames.travelled_m[ends].sum():,.0f} m",
        "keyframes": f"{len(solved.frames):,}",
        "odometry's sigmas": f"times {solved.drift_scale:g}",
        "closures believed": f"{len(solved.closures)} of {len(found.verdicts)}",
    }
    if solved.fixes is not None and solved.judged is not None:
        shown["fixes used"] = f"{int(solved.judged.used.sum())} of {len(solved.fixes)}"
        for kind in np.unique(solved.fixes.kind).tolist():
            session, quality = divmod(kind, len(KIND_NAMES))
            of = f" of {names[session]}" if len(names) > 1 else ""
            shown[f"sigmas, {KIND_NAMES[quality]}{of}"] = f"times {solved.judged.scale[kind]:.1f}"
    return shown
