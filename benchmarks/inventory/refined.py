"""A plot on the trajectory that the refinement makes of it: the walk's own loops closed, and a simulated receiver."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.fusion.table import received
from benchmarks.inventory.plots import SUBMAPS, TRACK, Plot, world_of
from benchmarks.odometry.simulated import EPOCH_NS
from drivers.messages import GnssFix
from drivers.sim.world import build
from pipeline.gnss.config import FusionConfig
from pipeline.products.track import read_track
from pipeline.refinement.config import RefinementConfig
from pipeline.refinement.refine import refine
from pipeline.refinement.session import Problem, Session
from pipeline.refinement.spread import placement
from pipeline.refinement.submaps import read_submaps

RECEIVER = "honest"


def refined(one: Plot, density: str, seed: int, config: RefinementConfig | None = None) -> Plot:
    """As `mapforest refine` places its map. Where the fixes do not tell the heading, the odometry's stays, as there."""
    track = read_track(one.folder / TRACK)
    session = Session(track, fixes(density, seed), FusionConfig(), read_submaps(one.folder / SUBMAPS))
    (found,) = refine(Problem((session,), config or RefinementConfig()))
    return replace(one, placement=placement(track, found.solution))


def fixes(density: str, seed: int) -> list[GnssFix]:
    """Of the walk, in the time of its sweeps."""
    heard = received(build(world_of(density, seed)), RECEIVER, seed)
    return [replace(fix, stamp_ns=fix.stamp_ns + EPOCH_NS, receive_ns=fix.receive_ns + EPOCH_NS) for fix in heard]
