"""What kind of forest to grow, and the kinds there are."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from drivers.errors import SimulationError
from drivers.sim.species import Species


def _mixed() -> dict[Species, float]:
    return {Species.OAK: 0.36, Species.MAPLE: 0.30, Species.PINE: 0.24, Species.SUMAC: 0.10}


@dataclass(frozen=True, slots=True)
class ForestConfig:
    """Densities are a hectare, diameters Weibull. mix: species and their shares; clones come on top, beside the route.

    corridor_m: half width of the forest around the route. row_m: distance of plantation rows, 0 for wild growth.
    """

    seed: int = 1
    corridor_m: float = 42.0
    stems_per_ha: float = 700.0
    spacing_m: float = 1.5
    clearance_m: float = 1.5
    dbh_scale_m: float = 0.20
    dbh_shape: float = 1.6
    lean_deg: float = 2.5
    mix: dict[Species, float] = field(default_factory=_mixed)
    clones_per_100m: float = 8.0
    taped_share: float = 0.03
    shrubs_per_ha: float = 500.0
    grass_per_ha: float = 1200.0
    logs_per_ha: float = 60.0
    row_m: float = 0.0
    meadow: bool = False
    relief: float = 0.5
    slope: float = 0.03
    trail_width_m: float = 1.2
    furniture: bool = True


PRESETS: dict[str, ForestConfig] = {
    "open_trail": ForestConfig(
        stems_per_ha=280.0, spacing_m=2.8, clearance_m=2.6, shrubs_per_ha=120.0, trail_width_m=2.4, dbh_scale_m=0.28
    ),
    "mixed": ForestConfig(),
    "dense": ForestConfig(stems_per_ha=1300.0, spacing_m=1.2, dbh_scale_m=0.15, shrubs_per_ha=900.0),
    "thicket": ForestConfig(
        stems_per_ha=2600.0,
        spacing_m=0.8,
        dbh_scale_m=0.08,
        dbh_shape=1.4,
        shrubs_per_ha=2600.0,
        trail_width_m=0.8,
        clones_per_100m=12.0,
        furniture=False,
    ),
    "meadow_edge": ForestConfig(meadow=True, grass_per_ha=4500.0, stems_per_ha=800.0),
    "plantation": ForestConfig(
        row_m=3.2,
        spacing_m=2.2,
        dbh_scale_m=0.20,
        dbh_shape=5.0,
        lean_deg=1.0,
        mix={Species.PINE: 1.0},
        clones_per_100m=3.0,
        shrubs_per_ha=80.0,
        relief=0.25,
    ),
    "slope": ForestConfig(slope=0.30, relief=0.8, lean_deg=4.0),
}


def preset(name: str, seed: int) -> ForestConfig:
    """The forest of that name with that seed. SimulationError names the ones there are."""
    if name not in PRESETS:
        raise SimulationError(f"forest {name!r}: expected one of {', '.join(PRESETS)}")
    return replace(PRESETS[name], seed=seed)
