"""Products that lie beside the simulated truth they are compared with: another datum, and an estimate that is off."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import msgspec
import numpy as np

from drivers.sim.scenarios import scenario
from drivers.sim.truth import write_epoch, write_truth
from drivers.sim.world import World, build
from edge.process.product_facts import FindingFacts, ProductFacts
from pipeline.gnss.geodesy import Datum
from pipeline.products.tum import write_tum

EPOCH_NS, OFFSET_NS = 5_000_000_000, 1_790_000_000_000_000_000
HERE = (40.0575, -75.2180, 60.0)
"""The session's datum, which is not the world's."""


@cache
def short_trail() -> World:
    """A way of 16 m through trees, grown once."""
    return build(replace(scenario("open_trail", 4), length_m=16.0))


def write_true(folder: Path) -> Path:
    """The truth as the simulator leaves it."""
    write_truth(short_trail(), folder)
    write_epoch(folder, EPOCH_NS)
    return folder


def in_map(places_m: np.ndarray) -> np.ndarray:
    """Places of the world (n, 3) in the session's map."""
    datum, here = short_trail().config.datum, Datum(*HERE)
    there = Datum(datum.latitude_deg, datum.longitude_deg, datum.height_m)
    return np.asarray(places_m @ (here.turn.T @ there.turn).T + here.turn.T @ (there.origin_m - here.origin_m))


def write_products(folder: Path, t_ns: np.ndarray, off_m: np.ndarray, findings: FindingFacts | None = None) -> None:
    """A trajectory at walk times t_ns that is `off_m` from the true one, and what the products say of themselves."""
    positions, rotations = short_trail().trajectory.poses(t_ns)
    write_tum(folder / "trajectory.tum", t_ns + EPOCH_NS + OFFSET_NS, in_map(positions + off_m), rotations)
    write_facts(folder, findings)


def write_facts(folder: Path, findings: FindingFacts | None = None) -> None:
    facts = ProductFacts("walk", "map", "", datum=HERE, host_offset_ns=OFFSET_NS, findings=findings)
    (folder / "products.json").write_bytes(msgspec.json.encode(facts))
