"""Plots as SVG text, made to be read offline: no script, no font, no library."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
WIDTH, LEFT, RIGHT, TOP, BOTTOM = 960, 64, 16, 12, 36
_MOST_POINTS = 1600


@dataclass(frozen=True, slots=True)
class Line:
    """A curve. tone: a CSS class of the page (a, b, c). NaN breaks it."""

    x: Array
    y: Array
    name: str
    tone: str = "a"


@dataclass(frozen=True, slots=True)
class Dots:
    """Single points."""

    x: Array
    y: Array
    name: str
    tone: str = "b"


@dataclass(frozen=True, slots=True)
class Plot:
    """One pair of axes. bands: (from, to) stretches of x that are shaded. equal: one scale for both axes."""

    x_label: str
    y_label: str
    lines: Sequence[Line] = ()
    dots: Sequence[Dots] = ()
    bands: Sequence[tuple[float, float]] = ()
    y_names: Sequence[str] = ()
    """Names of the y values 0, 1, 2, ... instead of numbers."""
    height: int = 200
    equal: bool = False
    from_zero: bool = False

    @property
    def marks(self) -> tuple[Line | Dots, ...]:
        """Everything drawn."""
        return (*self.lines, *self.dots)

    def svg(self) -> str:
        """The element, `viewBox` only: it takes the width of the page."""
        axes = _Axes.around(self)
        parts = [*axes.bands(self.bands), *axes.grid(self)]
        parts += [_path(axes, line) for line in self.lines]
        parts += [_circles(axes, dots) for dots in self.dots]
        parts += _legend([(one.name, one.tone) for one in self.marks if one.name])
        label = escape(f"{self.y_label} over {self.x_label}")
        return (
            f'<svg viewBox="0 0 {WIDTH} {axes.height}" role="img" aria-label="{label}">\n'
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
    height: int

    @classmethod
    def around(cls, plot: Plot) -> _Axes:
        x0, x1 = _bounds([one.x for one in plot.marks])
        y0, y1 = _bounds([one.y for one in plot.marks])
        if plot.from_zero:
            y0 = min(0.0, y0)
        if plot.y_names:
            y0, y1 = -0.5, len(plot.y_names) - 0.5
        elif not plot.equal:
            margin = 0.06 * (y1 - y0)
            y0, y1 = (y0 if plot.from_zero else y0 - margin), y1 + margin
        height = plot.height
        if plot.equal:
            x0, x1, y0, y1, height = _squared(x0, x1, y0, y1)
        return cls(x0, x1, y0, y1, height)

    def x(self, value: Array) -> Array:
        return LEFT + (value - self.x0) / (self.x1 - self.x0) * (WIDTH - LEFT - RIGHT)

    def y(self, value: Array) -> Array:
        return self.height - BOTTOM - (value - self.y0) / (self.y1 - self.y0) * (self.height - TOP - BOTTOM)

    def bands(self, bands: Sequence[tuple[float, float]]) -> list[str]:
        found = []
        for start, end in bands:
            left, right = self.x(np.array([start, end])).tolist()
            found.append(
                f'<rect class="band" x="{left:.1f}" y="{TOP}" width="{max(right - left, 1.0):.1f}" '
                f'height="{self.height - TOP - BOTTOM}"/>'
            )
        return found

    def grid(self, plot: Plot) -> list[str]:
        parts = []
        for value in ticks(self.x0, self.x1, 8):
            at = float(self.x(np.array(value)))
            parts.append(f'<line class="grid" x1="{at:.1f}" x2="{at:.1f}" y1="{TOP}" y2="{self.height - BOTTOM}"/>')
            parts.append(f'<text x="{at:.1f}" y="{self.height - BOTTOM + 14}" text-anchor="middle">{value:g}</text>')
        names = plot.y_names or None
        for value in range(len(names)) if names else ticks(self.y0, self.y1, max(self.height // 45, 3)):
            at = float(self.y(np.array(float(value))))
            text = names[int(value)] if names else f"{value:g}"
            parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at:.1f}" y2="{at:.1f}"/>')
            parts.append(f'<text x="{LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">{escape(text)}</text>')
        middle = (WIDTH + LEFT - RIGHT) / 2
        parts.append(f'<text x="{middle:.0f}" y="{self.height - 4}" text-anchor="middle">{escape(plot.x_label)}</text>')
        return parts


def ticks(low: float, high: float, about: int) -> list[float]:
    """Round values between two bounds."""
    rough = (high - low) / max(about, 1)
    scale = 10.0 ** math.floor(math.log10(rough))
    step = next(k * scale for k in (1.0, 2.0, 5.0, 10.0) if k * scale >= rough)
    first = math.ceil(low / step)
    return [round(k * step, 12) for k in range(first, math.floor(high / step) + 1)]


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """At most about `_MOST_POINTS`, with the least and the greatest of each stretch: no peak is lost."""
    if len(x) <= _MOST_POINTS:
        return x, y
    stretches = np.array_split(np.arange(len(x)), _MOST_POINTS // 2)
    filled = np.nan_to_num(y)
    kept = sorted({int(s[k]) for s in stretches for k in (np.argmin(filled[s]), np.argmax(filled[s]))})
    return x[kept], y[kept]


def _path(axes: _Axes, line: Line) -> str:
    x, y = (line.x, line.y) if np.any(np.diff(line.x) < 0) else thinned(line.x, line.y)
    words, pen_up = [], True
    for px, py in zip(axes.x(x).tolist(), axes.y(y).tolist(), strict=True):
        if not math.isfinite(px + py):
            pen_up = True
            continue
        words.append(f"{'M' if pen_up else 'L'}{px:.1f} {py:.1f}")
        pen_up = False
    return f'<path class="line {line.tone}" d="{"".join(words)}"/>'


def _circles(axes: _Axes, dots: Dots) -> str:
    every = max(1, len(dots.x) // _MOST_POINTS)
    pairs = zip(axes.x(dots.x[::every]).tolist(), axes.y(dots.y[::every]).tolist(), strict=True)
    marks = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in pairs if math.isfinite(x + y))
    return f'<path class="dots {dots.tone}" d="{marks}"/>'


def _legend(names: list[tuple[str, str]]) -> list[str]:
    parts, at = [], LEFT + 10
    for name, tone in names:
        parts.append(f'<path class="dots {tone}" d="M{at} {TOP + 10}h10"/>')
        parts.append(f'<text x="{at + 18}" y="{TOP + 14}">{escape(name)}</text>')
        at += 34 + 7 * len(name)
    return parts


def _bounds(arrays: Sequence[Array]) -> tuple[float, float]:
    values = np.concatenate([np.asarray(array, float).ravel() for array in arrays]) if arrays else np.empty(0)
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    if high - low < 1e-9:
        return low - 0.5, high + 0.5
    return low, high


def _squared(x0: float, x1: float, y0: float, y1: float) -> tuple[float, float, float, float, int]:
    """Bounds and a height with one scale on both axes, for ways of any shape."""
    wide = max(x1 - x0, 1.0) * 1.08
    tall = max(y1 - y0, 1.0) * 1.08
    inner = WIDTH - LEFT - RIGHT
    height = min(max(inner * tall / wide, 160.0), 620.0)
    metres = max(wide / inner, tall / height)
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    half_x, half_y = metres * inner / 2, metres * height / 2
    return x - half_x, x + half_x, y - half_y, y + half_y, round(height) + TOP + BOTTOM
