"""Surfaces of the simulated forest as the camera sees them: bark, litter, soil, and the forest far away."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from drivers.sim.species import TRAITS, Species

Texture = npt.NDArray[np.uint8]
TILE_M = 4.0
"""Side of the ground textures."""
_BARK: dict[Species, tuple[int, int, int]] = {
    Species.OAK: (84, 74, 64),
    Species.MAPLE: (112, 104, 96),
    Species.PINE: (104, 78, 62),
    Species.SUMAC: (98, 86, 74),
    Species.TREE_OF_HEAVEN: (168, 160, 146),
    Species.SHRUB: (92, 82, 70),
    Species.GRASS: (120, 112, 80),
}


@dataclass(frozen=True, slots=True, eq=False)
class Textures:
    """bark (species, 64, 64, 3); litter, soil (256, 256, 3), tiles of `TILE_M`; far (256, 1024, 3), elevation down."""

    bark: Texture
    litter: Texture
    soil: Texture
    far: Texture


def paint_textures(seed: int) -> Textures:
    """All surfaces, the same from the same seed."""
    rng = np.random.default_rng([seed, 73])
    bark = np.stack([_bark(Species(k), rng) for k in range(len(TRAITS))])
    return Textures(bark, _litter(rng), _soil(rng), _far(rng))


def _noise(rng: np.random.Generator, shape: tuple[int, int], cells: tuple[int, int]) -> npt.NDArray[np.float32]:
    """Smooth noise that tiles, about 0 +- 1, with so many cells down and across."""
    grid = rng.standard_normal(cells).astype(np.float32)
    padded = np.pad(grid, ((1, 2), (1, 2)), mode="wrap")
    scale = (shape[0] / cells[0], shape[1] / cells[1])
    size = (round(padded.shape[1] * scale[1]), round(padded.shape[0] * scale[0]))
    large = cv2.resize(padded, size, interpolation=cv2.INTER_CUBIC)
    top, left = round(scale[0]), round(scale[1])
    return np.asarray(large[top : top + shape[0], left : left + shape[1]], dtype=np.float32)


def _coloured(value: npt.NDArray[np.float32], base: tuple[int, int, int]) -> Texture:
    return np.asarray(np.clip(value[..., None] * np.array(base, np.float32), 0, 255), dtype=np.uint8)


def _bark(species: Species, rng: np.random.Generator) -> Texture:
    """Furrows along the stem; Tree-of-Heaven is smooth and pale with fine light stripes."""
    shape = (64, 64)
    if species is Species.TREE_OF_HEAVEN:
        value = 1.0 + 0.05 * _noise(rng, shape, (4, 16)) + 0.06 * (_noise(rng, shape, (3, 24)) > 1.1)
        return _coloured(np.asarray(value, np.float32), _BARK[species])
    cells = (16, 6) if species is Species.PINE else (5, 18)
    value = 1.0 + 0.26 * _noise(rng, shape, cells) + 0.12 * _noise(rng, shape, (24, 24))
    return _coloured(np.asarray(value, np.float32), _BARK[species])


def _litter(rng: np.random.Generator) -> Texture:
    """Dead leaves on dark ground, with some green."""
    tile = _coloured(0.9 + 0.25 * _noise(rng, (256, 256), (32, 32)), (92, 76, 52))
    for _ in range(900):
        x, y = rng.integers(0, 256, 2)
        warm = np.array((134, 104, 62)) if rng.random() < 0.8 else np.array((86, 102, 52))
        colour = tuple(int(c) for c in np.clip(warm * rng.uniform(0.6, 1.2), 0, 255))
        axes = (int(rng.integers(2, 5)), int(rng.integers(1, 3)))
        cv2.ellipse(tile, (int(x), int(y)), axes, rng.uniform(0, 180), 0, 360, colour, -1)
    return tile


def _soil(rng: np.random.Generator) -> Texture:
    value = 1.0 + 0.12 * _noise(rng, (256, 256), (12, 12)) + 0.10 * _noise(rng, (256, 256), (90, 90))
    return _coloured(np.asarray(value, np.float32), (140, 118, 92))


def _far(rng: np.random.Generator) -> Texture:
    """The forest beyond what is drawn: rows are elevation from +60 to -30 degrees, columns the whole round."""
    rows, columns = 256, 1024
    elevation = np.linspace(60.0, -30.0, rows, dtype=np.float32)[:, None]
    leaves = 0.75 + 0.22 * _noise(rng, (rows, columns), (64, 256)) + 0.15 * _noise(rng, (rows, columns), (16, 64))
    picture = _coloured(np.asarray(leaves, np.float32), (104, 128, 84)).astype(np.float32)
    stems = (np.abs(_noise(rng, (1, columns), (1, 256))) < 0.12) & (elevation < 22.0)
    picture[stems] *= 0.62
    gaps = _noise(rng, (rows, columns), (40, 120)) + 0.06 * (elevation - 26.0)
    sky = np.array((206, 218, 226), np.float32)
    share = np.clip(1.6 * gaps, 0.0, 1.0)[..., None]
    return np.asarray(picture * (1.0 - share) + sky * share, dtype=np.uint8)
