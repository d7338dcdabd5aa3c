"""One page about a session's trajectory, readable offline on anything with a browser."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from drivers.messages import FixQuality, GnssFix
from pipeline.products import sheet
from pipeline.products.covariance import PoseTable
from pipeline.products.plots import Dots, Line, Plot

Array = npt.NDArray[np.float64]
TIME = "seconds since the start"
_QUALITIES = (
    ("none", (FixQuality.INVALID,)),
    ("single", (FixQuality.SINGLE, FixQuality.DEAD_RECKONING, FixQuality.MANUAL, FixQuality.SIMULATOR)),
    ("DGPS", (FixQuality.DGPS, FixQuality.PPP)),
    ("float", (FixQuality.RTK_FLOAT,)),
    ("fixed", (FixQuality.RTK_FIXED,)),
)


@dataclass(frozen=True, slots=True)
class Story:
    """What the page tells. fixes_m: (m, 3) the fixes in the frame of the poses, or none where they cannot be put there.

    facts: label -> text. notes: sentences.
    """

    title: str
    poses: PoseTable
    fixes: Sequence[GnssFix]
    fixes_m: Array
    facts: dict[str, str]
    notes: Sequence[str]


def write_page(path: Path, story: Story) -> None:
    """Write it."""
    poses = story.poses
    start_ns = int(poses.stamps_ns[0])
    figures = [sheet.figure("Way from above", way(poses, story.fixes, story.fixes_m))]
    figures += [sheet.figure(title, plot) for title, plot in (*movement(poses, start_ns), *certainty(poses, start_ns))]
    if story.fixes:
        figures.append(sheet.figure("GNSS quality", quality(story.fixes, start_ns)))
    parts = [sheet.facts(story.facts), *figures, sheet.notes(story.notes)]
    path.write_text(sheet.sheet(story.title, parts), encoding="utf-8")


def way(poses: PoseTable, fixes: Sequence[GnssFix], fixes_m: Array) -> Plot:
    """From above, the good fixes apart from the others."""
    axes = ("east, m", "north, m") if poses.frame == "map" else ("x, m", "y, m")
    line = Line(poses.positions_m[:, 0], poses.positions_m[:, 1], "way")
    return Plot(*axes, [line], fix_dots(fixes, fixes_m), equal=True)


def fix_dots(fixes: Sequence[GnssFix], fixes_m: Array) -> list[Dots]:
    """fixes_m: (m, 3) where they lie; none, or NaN, for those that lie nowhere."""
    if not np.isfinite(fixes_m).any():
        return []
    good = np.array([fix.quality in (FixQuality.RTK_FIXED, FixQuality.RTK_FLOAT) for fix in fixes])
    kinds = ((~good, "GNSS: single, DGPS", "b"), (good, "RTK", "c"))
    east, north = fixes_m[:, 0], fixes_m[:, 1]
    return [Dots(east[which], north[which], name, tone) for which, name, tone in kinds if which.any()]


def movement(poses: PoseTable, start_ns: int) -> Iterator[tuple[str, Plot]]:
    """Height and speed."""
    seconds, bands = _time(poses, start_ns)
    yield "Height, m", Plot(TIME, "height", [Line(seconds, poses.positions_m[:, 2], "")], bands=bands)
    yield (
        "Speed, m/s",
        Plot(TIME, "speed", [Line(seconds, poses.speed_m_s, "")], bands=bands, from_zero=True, height=150),
    )


def certainty(poses: PoseTable, start_ns: int) -> Iterator[tuple[str, Plot]]:
    """What the estimators say of themselves."""
    seconds, bands = _time(poses, start_ns)
    sigma = [
        Line(seconds, poses.horizontal_sigma_m, "horizontal"),
        Line(seconds, poses.sigmas[:, 2], "vertical", "c"),
    ]
    yield (
        "How well the position is known (one sigma, m); shaded: the LiDAR alone could not tell",
        Plot(TIME, "sigma", sigma, bands=bands, from_zero=True),
    )
    share = Line(seconds, poses.matches / np.maximum(poses.points, 1), "")
    yield "Points matched, of those used", Plot(TIME, "share", [share], bands=bands, from_zero=True, height=130)


def quality(fixes: Sequence[GnssFix], start_ns: int) -> Plot:
    """Of each fix, over time."""
    at = np.array([(fix.stamp_ns - start_ns) / 1e9 for fix in fixes])
    rank = {kind: row for row, (_, kinds) in enumerate(_QUALITIES) for kind in kinds}
    rows = np.array([float(rank[fix.quality]) for fix in fixes])
    return Plot(TIME, "quality", dots=[Dots(at, rows, "")], y_names=[name for name, _ in _QUALITIES], height=150)


def _time(poses: PoseTable, start_ns: int) -> tuple[Array, list[tuple[float, float]]]:
    """Seconds (n,), and the stretches to shade."""
    seconds = (poses.stamps_ns - start_ns) / 1e9
    return seconds, degenerate_stretches(seconds, poses.degenerate)


def degenerate_stretches(seconds: Array, degenerate: npt.NDArray[np.bool_]) -> list[tuple[float, float]]:
    """(from, to) in seconds."""
    edges = np.diff(np.concatenate([[0], degenerate.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return [(float(seconds[a]), float(seconds[b])) for a, b in zip(starts, ends, strict=True)]
