"""One page about a session's trajectory, readable offline on anything with a browser."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from drivers.messages import FixQuality, GnssFix
from pipeline.products import sheet
from pipeline.products.covariance import horizontal_sigma_m, sigmas
from pipeline.products.plots import Dots, Line, Plot

Array = npt.NDArray[np.float64]
_QUALITIES = (
    ("none", (FixQuality.INVALID,)),
    ("single", (FixQuality.SINGLE, FixQuality.DEAD_RECKONING, FixQuality.MANUAL, FixQuality.SIMULATOR)),
    ("DGPS", (FixQuality.DGPS, FixQuality.PPP)),
    ("float", (FixQuality.RTK_FLOAT,)),
    ("fixed", (FixQuality.RTK_FIXED,)),
)


@dataclass(frozen=True, slots=True)
class Story:
    """What the page tells. positions_m, covariance: of the track's poses in `frame` (map or odom).

    fixes_m: (m, 3) the fixes in `frame`, NaN where they cannot be put there. facts: label -> text. notes: sentences.
    """

    title: str
    frame: str
    track: npt.NDArray[np.void]
    positions_m: Array
    covariance: Array
    fixes: Sequence[GnssFix]
    fixes_m: Array
    facts: dict[str, str]
    notes: Sequence[str]


def write_page(path: Path, story: Story) -> None:
    """Write it."""
    figures = [sheet.figure(title, plot) for title, plot in _plots(story)]
    parts = [sheet.facts(story.facts), *figures, sheet.notes(story.notes)]
    path.write_text(sheet.sheet(story.title, parts), encoding="utf-8")


def degenerate_stretches(seconds: Array, degenerate: npt.NDArray[np.bool_]) -> list[tuple[float, float]]:
    """(from, to) in seconds."""
    edges = np.diff(np.concatenate([[0], degenerate.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return [(float(seconds[a]), float(seconds[b])) for a, b in zip(starts, ends, strict=True)]


def _plots(story: Story) -> list[tuple[str, Plot]]:
    track = story.track
    start_ns = int(track["stamp_ns"][0]) if len(track) else 0
    seconds = (track["stamp_ns"] - start_ns) / 1e9
    bands = degenerate_stretches(seconds, track["degenerate"])
    spread = sigmas(story.covariance) if len(track) else np.empty((0, 6))
    speed = np.linalg.norm(track["velocity_m_s"], axis=1)
    positions = story.positions_m
    axes = ("east, m", "north, m") if story.frame == "map" else ("x, m", "y, m")
    way = Plot(axes[0], axes[1], [Line(positions[:, 0], positions[:, 1], "way")], _fixes(story), equal=True)
    time = "seconds since the start"
    plots = [
        ("Way from above", way),
        ("Height, m", Plot(time, "height", [Line(seconds, positions[:, 2], "")], bands=bands)),
        ("Speed, m/s", Plot(time, "speed", [Line(seconds, speed, "")], bands=bands, from_zero=True, height=150)),
        (
            "How well the position is known (one sigma, m); shaded: the LiDAR alone could not tell",
            Plot(
                time,
                "sigma",
                [
                    Line(seconds, horizontal_sigma_m(story.covariance), "horizontal"),
                    Line(seconds, spread[:, 2], "vertical", "c"),
                ],
                bands=bands,
                from_zero=True,
            ),
        ),
        ("Points matched, of those used", _matches(seconds, track, bands, time)),
    ]
    if story.fixes:
        plots.append(("GNSS quality", _quality(story.fixes, start_ns, time)))
    return plots


def _fixes(story: Story) -> list[Dots]:
    """On the map, the good ones apart from the others."""
    if not np.isfinite(story.fixes_m).any():
        return []
    good = np.array([fix.quality in (FixQuality.RTK_FIXED, FixQuality.RTK_FLOAT) for fix in story.fixes])
    kinds = ((~good, "GNSS: single, DGPS", "b"), (good, "RTK", "c"))
    east, north = story.fixes_m[:, 0], story.fixes_m[:, 1]
    return [Dots(east[which], north[which], name, tone) for which, name, tone in kinds if which.any()]


def _matches(seconds: Array, track: npt.NDArray[np.void], bands: list[tuple[float, float]], time: str) -> Plot:
    share = track["matches"] / np.maximum(track["points"], 1)
    return Plot(time, "share", [Line(seconds, share, "")], bands=bands, from_zero=True, height=130)


def _quality(fixes: Sequence[GnssFix], start_ns: int, time: str) -> Plot:
    at = np.array([(fix.stamp_ns - start_ns) / 1e9 for fix in fixes])
    rank = {quality: row for row, (_, qualities) in enumerate(_QUALITIES) for quality in qualities}
    rows = np.array([float(rank[fix.quality]) for fix in fixes])
    return Plot(time, "quality", dots=[Dots(at, rows, "")], y_names=[name for name, _ in _QUALITIES], height=150)
