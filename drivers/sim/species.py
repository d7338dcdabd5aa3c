"""The species of the simulated forest, with what geometry, laser and camera need to know of each.

Tree-of-Heaven (Ailanthus altissima) is the one to be found; staghorn sumac is its look-alike, with shorter leaves.
Reflectivities are diffuse, 0..1, at 905 nm: bark 0.2..0.5, green leaves about 0.45.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Species(IntEnum):
    """Index into `TRAITS` and into every `species` array."""

    OAK = 0
    MAPLE = 1
    PINE = 2
    SUMAC = 3
    TREE_OF_HEAVEN = 4
    SHRUB = 5
    GRASS = 6


class Leaf(IntEnum):
    """Shape of a leaf, for whoever draws it."""

    BROAD = 0
    NEEDLE = 1
    PINNATE = 2
    BLADE = 3


@dataclass(frozen=True, slots=True)
class Traits:
    """Height (m) of a grown stem of diameter d (m): 2.1 + ceiling_m * (1 - exp(-growth_per_m * d)); saplings are lower.

    crown_start: share of the height below the crown. crown_per_dbh: crown radius (m) a metre of diameter.
    extinction_per_m: of a beam inside a clump of leaves. frond_m: length of the pinnate leaf, 0 without.
    """

    name: str
    scientific: str
    leaf: Leaf
    bark: float
    foliage: float
    ceiling_m: float
    growth_per_m: float
    crown_start: float
    crown_per_dbh: float
    extinction_per_m: float
    frond_m: float


TRAITS: tuple[Traits, ...] = (
    Traits("oak", "Quercus rubra", Leaf.BROAD, 0.28, 0.45, 24.0, 4.5, 0.45, 11.0, 0.60, 0.0),
    Traits("maple", "Acer rubrum", Leaf.BROAD, 0.38, 0.47, 22.0, 5.0, 0.40, 11.5, 0.65, 0.0),
    Traits("pine", "Pinus strobus", Leaf.NEEDLE, 0.25, 0.38, 27.0, 4.2, 0.40, 8.0, 0.75, 0.0),
    Traits("staghorn sumac", "Rhus typhina", Leaf.PINNATE, 0.32, 0.46, 5.5, 14.0, 0.50, 18.0, 0.6, 0.42),
    Traits("tree-of-heaven", "Ailanthus altissima", Leaf.PINNATE, 0.48, 0.48, 21.0, 6.5, 0.50, 12.0, 0.45, 0.85),
    Traits("shrub", "Lonicera maackii", Leaf.BROAD, 0.30, 0.45, 3.0, 10.0, 0.2, 15.0, 2.0, 0.0),
    Traits("grass", "Poaceae", Leaf.BLADE, 0.30, 0.42, 0.5, 10.0, 0.0, 1.0, 4.0, 0.0),
)
