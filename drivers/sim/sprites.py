"""Pictures of clumps of leaves, drawn once and pasted wherever the scene has one.

What tells a Tree-of-Heaven apart in a picture is drawn from botany: leaves of half a metre to a metre with 10 to 20
pairs of long, smooth leaflets, hanging in loose rosettes; sumac's are half as long, dense, with a red rachis.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from drivers.sim.species import TRAITS, Leaf, Species, Traits

Picture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]
SIZES_PX = (192, 96, 48, 24, 12, 6)
"""Each clump is kept at these sizes; the renderer takes the next larger one."""
VARIANTS = 4
_DRAWN_AT = 4
"""Drawn so much larger and shrunk: smooth edges without anti-aliased drawing."""
GREENS: dict[Species, Colour] = {
    Species.OAK: (62, 92, 34),
    Species.MAPLE: (84, 118, 44),
    Species.PINE: (36, 66, 44),
    Species.SUMAC: (96, 104, 40),
    Species.TREE_OF_HEAVEN: (116, 156, 66),
    Species.SHRUB: (72, 110, 52),
    Species.GRASS: (122, 134, 66),
}


@dataclass(frozen=True, slots=True, eq=False)
class Sprites:
    """rgba: all pictures in a row, (n, 4) uint8, alpha 0 or 255. start[species, variant, size]: first pixel of one."""

    rgba: npt.NDArray[np.uint8]
    start: npt.NDArray[np.int64]


def draw_sprites(seed: int) -> Sprites:
    """All species in all variants and sizes."""
    rng = np.random.default_rng([seed, 71])
    pixels: list[Picture] = []
    start = np.zeros((len(TRAITS), VARIANTS, len(SIZES_PX)), dtype=np.int64)
    taken = 0
    for species in Species:
        for variant in range(VARIANTS):
            largest = _draw(species, rng).astype(np.float32)
            largest[..., 3] /= 255.0
            for size_index, size in enumerate(SIZES_PX):
                picture = _shrink(largest, size)
                pixels.append(picture.reshape(-1, 4))
                start[species, variant, size_index] = taken
                taken += size * size
    return Sprites(np.ascontiguousarray(np.concatenate(pixels)), start)


def _shrink(picture: npt.NDArray[np.float32], size: int) -> Picture:
    """Area average of a picture that is black where its alpha, 0 or 1, is 0; a pixel is leaf where a third is."""
    small = cv2.resize(picture, (size, size), interpolation=cv2.INTER_AREA)
    colour, cover = small[..., :3], small[..., 3]
    out = np.zeros((size, size, 4), dtype=np.uint8)
    out[..., :3] = np.clip(colour / np.maximum(cover, 1e-3)[..., None], 0, 255)
    out[..., 3] = np.where(cover > 0.33, 255, 0)
    return out


def _draw(species: Species, rng: np.random.Generator) -> Picture:
    size = SIZES_PX[0] * _DRAWN_AT
    canvas = np.zeros((size, size, 4), dtype=np.uint8)
    traits = TRAITS[species]
    drawers = {Leaf.BROAD: _broad, Leaf.NEEDLE: _needles, Leaf.PINNATE: _pinnate, Leaf.BLADE: _blades}
    drawers[traits.leaf](canvas, species, traits, rng)
    return canvas


def _tint(base: Colour, rng: np.random.Generator, spread: float = 0.22) -> tuple[int, int, int, int]:
    bright = 1.0 + spread * rng.standard_normal()
    red, green, blue = (int(min(max(c * bright, 8.0), 245.0)) for c in base)
    return red, green, blue, 255


def _broad(canvas: Picture, species: Species, traits: Traits, rng: np.random.Generator) -> None:
    """Single leaves at random in the disc, dark ones first, bright ones on top."""
    size = canvas.shape[0]
    for k in range(260):
        radius = 0.47 * size * np.sqrt(rng.random())
        bearing = rng.uniform(0.0, 2.0 * np.pi)
        centre = (int(size / 2 + radius * np.cos(bearing)), int(size / 2 + radius * np.sin(bearing)))
        length = size * rng.uniform(0.025, 0.05)
        lit = tuple(int(c * (0.55 + 0.6 * k / 260)) for c in GREENS[species])
        axes = (int(length), int(length * (0.75 if species is Species.MAPLE else 0.5)))
        cv2.ellipse(canvas, centre, axes, rng.uniform(0, 180), 0, 360, _tint((lit[0], lit[1], lit[2]), rng), -1)


def _needles(canvas: Picture, species: Species, traits: Traits, rng: np.random.Generator) -> None:
    """Tufts of needles on a few twigs."""
    size = canvas.shape[0]
    for _ in range(60):
        radius, bearing = 0.38 * size * np.sqrt(rng.random()), rng.uniform(0.0, 2.0 * np.pi)
        x, y = size / 2 + radius * np.cos(bearing), size / 2 + radius * np.sin(bearing)
        for angle in rng.uniform(0.0, 2.0 * np.pi, 26):
            length = size * rng.uniform(0.05, 0.11)
            end = (int(x + length * np.cos(angle)), int(y + length * np.sin(angle)))
            cv2.line(canvas, (int(x), int(y)), end, _tint(GREENS[species], rng, 0.3), 4)


def _blades(canvas: Picture, species: Species, traits: Traits, rng: np.random.Generator) -> None:
    """Grass blades that bend outwards from the foot of the picture."""
    size = canvas.shape[0]
    for _ in range(110):
        foot, height = size * rng.uniform(0.2, 0.8), size * rng.uniform(0.35, 0.95)
        bend = size * rng.normal(0.0, 0.18)
        along = np.linspace(0.0, 1.0, 8)
        line = np.column_stack([foot + bend * along**2, size - height * along]).astype(np.int32)
        cv2.polylines(canvas, [line], False, _tint(GREENS[species], rng, 0.25), 7)


def _pinnate(canvas: Picture, species: Species, traits: Traits, rng: np.random.Generator) -> None:
    """A loose rosette of long compound leaves, each bending down under its weight."""
    size = canvas.shape[0]
    heaven = species is Species.TREE_OF_HEAVEN
    fronds, pairs = (9, 13) if heaven else (11, 10)
    for k, bearing in enumerate(np.linspace(0.0, 2.0 * np.pi, fronds, endpoint=False)):
        angle = bearing + rng.normal(0.0, 0.18)
        length = size * rng.uniform(0.38, 0.48)
        lit = tuple(int(c * (0.7 + 0.4 * k / fronds)) for c in GREENS[species])
        x, y = _rachis(size, angle, length, pairs, droop=0.35 if heaven else 0.15)
        _frond(canvas, np.column_stack([x, y]), length, (lit[0], lit[1], lit[2]), heaven=heaven, rng=rng)
    if not heaven:  # the red cone of sumac
        cv2.ellipse(canvas, (size // 2, int(0.42 * size)), (size // 28, size // 11), 0, 0, 360, (132, 40, 36, 255), -1)


def _rachis(
    size: int, angle: float, length: float, pairs: int, *, droop: float
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Where the leaflets of a leaf sit: out from the middle, bending down."""
    along = np.linspace(0.0, 1.0, pairs + 2)
    x = size / 2 + length * along * np.cos(angle)
    y = size / 2 + length * (along * np.sin(angle) + droop * along**2)
    return x, y


def _frond(
    canvas: Picture,
    line: npt.NDArray[np.float64],
    length: float,
    green: Colour,
    *,
    heaven: bool,
    rng: np.random.Generator,
) -> None:
    rachis = (176, 168, 104, 255) if heaven else (150, 66, 52, 255)
    cv2.polylines(canvas, [line.astype(np.int32)], False, rachis, 5)
    for k in range(1, len(line)):
        heading = np.arctan2(*(line[k] - line[k - 1])[::-1])
        reach = length * (0.24 if heaven else 0.20) * (1.0 - 0.45 * abs(k / (len(line) - 1) - 0.4))
        for side in (-1.0, 1.0):
            leaf = heading + side * rng.normal(1.15, 0.1)
            centre = (int(line[k, 0] + 0.5 * reach * np.cos(leaf)), int(line[k, 1] + 0.5 * reach * np.sin(leaf)))
            axes = (int(0.5 * reach), int(reach * (0.16 if heaven else 0.13)))
            cv2.ellipse(canvas, centre, axes, np.degrees(leaf), 0, 360, _tint(green, rng, 0.1), -1)
