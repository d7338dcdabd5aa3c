"""The walks there are, by name. A `WorldConfig` and nothing else decides the whole world."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from drivers.errors import SimulationError
from drivers.sim.gnss_geodesy import Datum
from drivers.sim.imu import ImuConfig
from drivers.sim.lidar import LidarConfig
from drivers.sim.motion import Schedule

SITE = Datum(latitude_deg=40.0573, longitude_deg=-75.2183, height_m=58.0, geoid_separation_m=-33.6)
"""Origin of the simulated world."""


@dataclass(frozen=True, slots=True)
class WorldConfig:
    """forest, path and carrier are names (see `forest_config`, `paths`, `carriers`). shake scales hand shake.

    antenna_m: GNSS antenna in `base_link`, as in the default calibration.
    """

    name: str = "demo"
    seed: int = 7
    forest: str = "mixed"
    path: str = "loop"
    length_m: float = 43.0
    carrier: str = "handheld"
    shake: float = 1.0
    schedule: Schedule = field(default_factory=Schedule)
    antenna_m: tuple[float, float, float] = (-0.05, 0.0, 0.20)
    datum: Datum = SITE
    lidar: LidarConfig = field(default_factory=LidarConfig)
    imu: ImuConfig = field(default_factory=ImuConfig)


SCENARIOS: dict[str, WorldConfig] = {
    config.name: config
    for config in (
        WorldConfig(),
        WorldConfig("open_trail", forest="open_trail", length_m=150.0),
        WorldConfig("dense", forest="dense", length_m=120.0),
        WorldConfig("thicket", forest="thicket", path="out_and_back", length_m=100.0),
        WorldConfig("slope", forest="slope", length_m=150.0),
        WorldConfig("meadow_edge", forest="meadow_edge", length_m=150.0),
        WorldConfig("plantation", forest="plantation", length_m=200.0, carrier="backpack"),
        WorldConfig("backpack", path="out_and_back", length_m=200.0, carrier="backpack"),
        WorldConfig("bicycle", forest="open_trail", path="out_and_back", length_m=400.0, carrier="bicycle"),
        WorldConfig("uav", length_m=200.0, carrier="uav"),
        WorldConfig("shaking", length_m=80.0, shake=6.0),
        WorldConfig("standing", length_m=50.0, schedule=Schedule(3.0, 8.0, 3.0, 6, 60.0, calm=True)),
        WorldConfig("loop_800", length_m=800.0),
        WorldConfig("loop_1200", length_m=1200.0),
        WorldConfig("out_and_back_1200", path="out_and_back", length_m=1200.0, carrier="backpack"),
    )
}


def scenario(name: str, seed: int | None = None) -> WorldConfig:
    """The scenario of that name, with its own seed or another. SimulationError names the ones there are."""
    if name not in SCENARIOS:
        raise SimulationError(f"scenario {name!r}: expected one of {', '.join(SCENARIOS)}")
    return SCENARIOS[name] if seed is None else replace(SCENARIOS[name], seed=seed)
