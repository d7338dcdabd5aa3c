"""Both maps over each other before and after, as pictures and as one page that says what to think of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.alignment.correlate import turned
from pipeline.alignment.fields import scaled
from pipeline.alignment.grid import Array, Grid
from pipeline.alignment.layers import Layer
from pipeline.alignment.matching import CANOPY, RELIEF, STEMS, shared_layers
from pipeline.alignment.result import ALIGNED, Result
from pipeline.alignment.task import Done
from pipeline.alignment.transform import Transform
from pipeline.products import sheet
from pipeline.products.plots import Dots, Picture, Plot

_LONGEST_PX = 900
_SHARPEST_PX = 6
"""Pixels a cell at most."""
_BELOW, _ABOVE = np.array([106.0, 140.0, 60.0]), np.array([40.0, 110.0, 245.0])
"""Blue, green, red of the aerial and of the ground map at their strongest."""
_PAPER = 250.0
_TITLES = {
    STEMS: "Stems on the crown tops",
    CANOPY: "Canopy seen from the ground on the canopy seen from above",
    RELIEF: "Ground on ground",
}


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One layer before or after. png: as wide as `extent_m` (west, east, south, north) of the aerial map."""

    name: str
    when: str
    png: bytes
    extent_m: tuple[float, float, float, float]

    @property
    def title(self) -> str:
        """For people."""
        return _TITLES[self.name]


def views(done: Done) -> list[View]:
    """Of every layer that has something to show: the aerial map green, the ground map orange."""
    still = Transform(done.alignment.transform.pivot_m)
    found = []
    for one in shared_layers(done.fixed, done.moved, done.config):
        for when, pose in (("before", still), ("after", done.alignment.transform)):
            image = _over(one, done.fixed.grid, done.moved.grid, pose)
            found.append(View(one.name, when, _png(image), done.fixed.grid.extent_m))
    return found


def alignment_page(done: Done, result: Result, shown: list[View]) -> str:
    """The file. Offline, on a phone too."""
    parts = [_verdict(result), sheet.facts(_facts(result))]
    for number, view in enumerate(shown):
        name = f"view{number}"
        parts.append(sheet.picture(name, view.png))
        parts.append(sheet.figure(f"{view.title}, {view.when}", _plot(done, view, name)))
    layers = [[name, f"{nats:.1f}"] for name, nats in result.nats.items()]
    parts.append(sheet.figures("What each comparison says for this pose", ["comparison", "nats"], layers, _NATS))
    if result.notes:
        parts.append(sheet.notes(result.notes))
    return sheet.sheet(f"{done.placed.cloud.path.name} on {done.aerial.path.name}", parts)


_NATS = "Logarithm of how much likelier the maps are if they belong together like this than if they do not at all."


def _verdict(result: Result) -> str:
    if result.verdict == ALIGNED:
        told = f"known to {result.sigma_m:.2f} m and {result.sigma_deg:.1f}° (one sigma)"
        return sheet.verdict("Aligned", "good", told)
    told = ". ".join(doubt[0].upper() + doubt[1:] for doubt in result.doubts)
    return sheet.verdict("Not enough to tell", "bad", f"{told}. Nothing was moved; the pose below is a guess.")


def _facts(result: Result) -> dict[str, str]:
    rival = result.rival
    other = "none" if rival is None else f"{rival.away_m:.1f} m, {rival.away_deg:.0f}° away"
    height = "not known" if result.z_m is None else f"{result.z_m:+.2f} ± {result.sigma_z_m:.2f} m"
    return {
        "shift east": f"{result.x_m:+.2f} m",
        "shift north": f"{result.y_m:+.2f} m",
        "shift up": height,
        "turn, counter-clockwise": f"{result.yaw_deg:+.2f}°",
        "sigma": f"{result.sigma_m:.2f} m, {result.sigma_deg:.1f}°",
        "ahead of the best other answer": f"{result.margin_nats:.1f} nats, {result.asked_nats:.1f} asked for",
        "best other answer": other,
        "footprint on the aerial map": f"{result.overlap:.0%}",
        "stems": str(result.stems),
    }


def _plot(done: Done, view: View, name: str) -> Plot:
    """About the pivot: coordinates of millions of metres have no room beside the axes."""
    x, y = (round(value) for value in done.alignment.transform.pivot_m)
    west, east, south, north = view.extent_m
    picture = Picture(name, west - x, east - x, south - y, north - y)
    dots = list(_stems(done, view, np.array([x, y])))
    return Plot(f"m east of {x:,}", f"m north of {y:,}", dots=dots, picture=picture, equal=True)


def _stems(done: Done, view: View, about: Array) -> Iterator[Dots]:
    stems = done.moved.stems_m
    if stems is not None and view.name == STEMS:
        places = done.alignment.transform.apply(stems[:, :2]) if view.when == "after" else stems
        yield Dots(places[:, 0] - about[0], places[:, 1] - about[1], "stems", "c")


def _over(one: Layer, fixed: Grid, moving: Grid, pose: Transform) -> Array:
    """(nx, ny, 3) blue, green, red."""
    shift = np.array([pose.x_m, pose.y_m])
    onto = Grid(fixed.origin_m - shift, fixed.cell_m, fixed.shape)
    values, inside = turned(one, moving, onto, np.array(pose.pivot_m), pose.yaw_deg)
    below, above = scaled(one.fixed, one.known), scaled(values, inside > 0)
    ink = np.full((*fixed.shape, 3), _PAPER)
    for strength, tone in ((np.where(one.known, below, 0.0), _BELOW), (np.where(inside > 0, above, 0.0), _ABOVE)):
        # Ink on paper: where both are strong it is dark.
        ink *= 1.0 - strength[..., None] * (1.0 - tone / 255.0)
    ink[inside <= 0] = 0.75 * ink[inside <= 0] + 0.25 * _PAPER
    return ink


def _png(image: Array) -> bytes:
    """North up."""
    times = max(1, min(_SHARPEST_PX, _LONGEST_PX // max(image.shape[:2])))
    rows: npt.NDArray[np.uint8] = np.ascontiguousarray(image.transpose(1, 0, 2)[::-1].astype(np.uint8))
    size = (rows.shape[1] * times, rows.shape[0] * times)
    return bytes(cv2.imencode(".png", cv2.resize(rows, size, interpolation=cv2.INTER_LINEAR))[1])
