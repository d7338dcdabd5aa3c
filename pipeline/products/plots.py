"""Plots as SVG text, made to be read offline: no script, no font, no library."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
WIDE, NARROW = 960, 350
"""Widths in pixels that a plot is drawn for: a desk, and a phone held upright."""
LEFT, RIGHT, TOP, BOTTOM = 64, 16, 12, 36
LEGEND = 18
_POINTS_A_PIXEL = 1.7
_LEAST_STEP = 0.5
"""Pixels: what is nearer to the last point is not drawn."""


@dataclass(frozen=True, slots=True)
class Line:
    """A curve. tone: a CSS class of the page (a, b, c). NaN breaks it."""

    x: Array
    y: Array
    name: str
    tone: str = "a"


@dataclass(frozen=True, slots=True)
class Dots:
    """Single points. labels: what stands beside each, or none at all. each: none is left out, however many."""

    x: Array
    y: Array
    name: str
    tone: str = "b"
    labels: Sequence[str] = ()
    each: bool = False


@dataclass(frozen=True, slots=True)
class Picture:
    """Below the lines: an image of the page (`sheet.picture`) by its name, and where its edges lie."""

    name: str
    west: float
    east: float
    south: float
    north: float


@dataclass(frozen=True, slots=True)
class Plot:
    """One pair of axes. bands: (from, to) stretches of x that are shaded. equal: one scale for both axes."""

    x_label: str
    y_label: str
    lines: Sequence[Line] = ()
    dots: Sequence[Dots] = ()
    bands: Sequence[tuple[float, float]] = ()
    picture: Picture | None = None
    x_names: Sequence[str] = ()
    """Names of the x values 0, 1, 2, ... instead of numbers; y_names likewise."""
    y_names: Sequence[str] = ()
    height: int = 200
    equal: bool = False
    from_zero: bool = False

    @property
    def marks(self) -> tuple[Line | Dots, ...]:
        """Everything drawn."""
        return (*self.lines, *self.dots)

    def svg(self, width: int = WIDE, name: str = "") -> str:
        """The element, `viewBox` only: it takes the width of the page. name: its CSS class."""
        legend = _legend([(one.name, one.tone) for one in self.marks if one.name], width)
        axes = _Axes.around(self, width, legend.height)
        most = int(_POINTS_A_PIXEL * width)
        parts = [axes.below(self.picture)] if self.picture is not None else []
        parts += [*axes.bands(self.bands), *axes.grid(self)]
        parts += [_path(axes, line, most) for line in self.lines]
        parts += [_circles(axes, dots, most) for dots in self.dots]
        parts += [text for dots in self.dots for text in _labels(axes, dots)]
        parts += legend.parts
        label = escape(f"{self.y_label} over {self.x_label}")
        return (
            f'<svg class="{name}" viewBox="0 0 {width} {axes.height}" role="img" aria-label="{label}">\n'
            + "\n".join(parts)
            + "\n</svg>"
        )


@dataclass(frozen=True, slots=True)
class _Axes:
    """Where values lie in the picture."""

    x0: float
    x1: float
    y0: float
    y1: float
    width: int
    top: int
    height: int

    @classmethod
    def around(cls, plot: Plot, width: int, legend: int) -> _Axes:
        edges = plot.picture
        wide, high = ([edges.west, edges.east], [edges.south, edges.north]) if edges else ([], [])
        x0, x1 = _bounds([*(one.x for one in plot.marks), np.array(wide)])
        y0, y1 = _bounds([*(one.y for one in plot.marks), np.array(high)])
        if plot.x_names:
            x0, x1 = -0.5, len(plot.x_names) - 0.5
        if plot.from_zero:
            y0 = min(0.0, y0)
        if plot.y_names:
            y0, y1 = -0.5, len(plot.y_names) - 0.5
        elif not plot.equal:
            margin = 0.06 * (y1 - y0)
            y0, y1 = (y0 if plot.from_zero else y0 - margin), y1 + margin
        height = plot.height
        if plot.equal:
            x0, x1, y0, y1, height = _squared(x0, x1, y0, y1, width)
        return cls(x0, x1, y0, y1, width, TOP + legend, height + legend)

    def x(self, value: Array) -> Array:
        return LEFT + (value - self.x0) / (self.x1 - self.x0) * (self.width - LEFT - RIGHT)

    def y(self, value: Array) -> Array:
        return self.height - BOTTOM - (value - self.y0) / (self.y1 - self.y0) * (self.height - self.top - BOTTOM)

    def below(self, picture: Picture) -> str:
        left, right = self.x(np.array([picture.west, picture.east])).tolist()
        bottom, top = self.y(np.array([picture.south, picture.north])).tolist()
        moved = f"translate({left:.1f} {top:.1f}) scale({right - left:.2f} {bottom - top:.2f})"
        return f'<use href="#{picture.name}" transform="{moved}"/>'

    def bands(self, bands: Sequence[tuple[float, float]]) -> list[str]:
        found = []
        for start, end in bands:
            left, right = self.x(np.array([start, end])).tolist()
            found.append(
                f'<rect class="band" x="{left:.1f}" y="{self.top}" width="{max(right - left, 1.0):.1f}" '
                f'height="{self.height - self.top - BOTTOM}"/>'
            )
        return found

    def grid(self, plot: Plot) -> list[str]:
        parts = []
        for value, text in _marked(plot.x_names, self.x0, self.x1, max(self.width // 110, 5)):
            at = float(self.x(np.array(value)))
            bottom = self.height - BOTTOM
            parts.append(f'<line class="grid" x1="{at:.1f}" x2="{at:.1f}" y1="{self.top}" y2="{bottom}"/>')
            parts.append(f'<text x="{at:.1f}" y="{bottom + 14}" text-anchor="middle">{text}</text>')
        for value, text in _marked(plot.y_names, self.y0, self.y1, max(self.height // 40, 3)):
            at = float(self.y(np.array(value)))
            parts.append(f'<line class="grid" x1="{LEFT}" x2="{self.width - RIGHT}" y1="{at:.1f}" y2="{at:.1f}"/>')
            parts.append(f'<text x="{LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">{text}</text>')
        middle = (self.width + LEFT - RIGHT) / 2
        parts.append(f'<text x="{middle:.0f}" y="{self.height - 4}" text-anchor="middle">{escape(plot.x_label)}</text>')
        return parts


def _marked(names: Sequence[str], low: float, high: float, about: int) -> list[tuple[float, str]]:
    """Values that the axis is marked at, with what stands there."""
    if names:
        return [(float(k), escape(name)) for k, name in enumerate(names)]
    return [(value, f"{value:g}") for value in ticks(low, high, about)]


def ticks(low: float, high: float, about: int) -> list[float]:
    """Round values between two bounds."""
    rough = (high - low) / max(about, 1)
    scale = 10.0 ** math.floor(math.log10(rough))
    step = next(k * scale for k in (1.0, 2.0, 5.0, 10.0) if k * scale >= rough)
    first = math.ceil(low / step)
    return [round(k * step, 12) for k in range(first, math.floor(high / step) + 1)]


def thinned(x: Array, y: Array, most: int) -> tuple[Array, Array]:
    """At most about so many, with the least and the greatest of each stretch: no peak is lost."""
    if len(x) <= most:
        return x, y
    stretches = np.array_split(np.arange(len(x)), most // 2)
    filled = np.nan_to_num(y)
    kept = sorted({int(s[k]) for s in stretches for k in (np.argmin(filled[s]), np.argmax(filled[s]))})
    return x[kept], y[kept]


def _path(axes: _Axes, line: Line, most: int) -> str:
    x, y = (line.x, line.y) if np.any(np.diff(line.x) < 0) else thinned(line.x, line.y, most)
    words, at = [], None
    for px, py in zip(axes.x(x).tolist(), axes.y(y).tolist(), strict=True):
        if not math.isfinite(px + py):
            at = None
        elif at is None or abs(px - at[0]) + abs(py - at[1]) >= _LEAST_STEP:
            words.append(f"{'L' if at else 'M'}{px:.1f} {py:.1f}")
            at = px, py
    return f'<path class="line {line.tone}" d="{"".join(words)}"/>'


def _circles(axes: _Axes, dots: Dots, most: int) -> str:
    every = 1 if dots.each else max(1, len(dots.x) // most)
    pairs = zip(axes.x(dots.x[::every]).tolist(), axes.y(dots.y[::every]).tolist(), strict=True)
    marks = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in pairs if math.isfinite(x + y))
    return f'<path class="dots {dots.tone}" d="{marks}"/>'


def _labels(axes: _Axes, dots: Dots) -> list[str]:
    places = zip(axes.x(dots.x).tolist(), axes.y(dots.y).tolist(), dots.labels, strict=False)
    return [f'<text class="label" x="{x + 5:.1f}" y="{y - 4:.1f}">{escape(text)}</text>' for x, y, text in places]


@dataclass(frozen=True, slots=True)
class _Legend:
    parts: list[str]
    height: int


def _legend(names: list[tuple[str, str]], width: int) -> _Legend:
    """Above the axes, in as many rows as it takes."""
    parts, at, row = [], LEFT, 0
    for name, tone in names:
        size = 34 + 7 * len(name)
        if at > LEFT and at + size > width:
            at, row = LEFT, row + 1
        y = TOP + LEGEND * row
        parts.append(f'<path class="dots {tone}" d="M{at} {y}h10"/>')
        parts.append(f'<text x="{at + 18}" y="{y + 4}">{escape(name)}</text>')
        at += size
    return _Legend(parts, LEGEND * (row + 1) if names else 0)


def _bounds(arrays: Sequence[Array]) -> tuple[float, float]:
    values = np.concatenate([np.asarray(array, float).ravel() for array in arrays]) if arrays else np.empty(0)
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    if high - low < 1e-9:
        return low - 0.5, high + 0.5
    return low, high


def _squared(x0: float, x1: float, y0: float, y1: float, width: int) -> tuple[float, float, float, float, int]:
    """Bounds and a height with one scale on both axes, for ways of any shape."""
    wide = max(x1 - x0, 1.0) * 1.08
    tall = max(y1 - y0, 1.0) * 1.08
    inner = width - LEFT - RIGHT
    height = min(max(inner * tall / wide, 160.0), 620.0)
    metres = max(wide / inner, tall / height)
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    half_x, half_y = metres * inner / 2, metres * height / 2
    return x - half_x, x + half_x, y - half_y, y + half_y, round(height) + TOP + BOTTOM
