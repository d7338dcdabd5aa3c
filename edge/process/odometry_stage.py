"""First stage: every sweep through the odometry. Writes the track, the fixes, the map's tiles, and its submaps."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec

from drivers.messages import GnssFix
from edge.config import Products
from edge.process.ahead import ahead
from edge.process.estimators import Odometry, Tracked
from edge.replay.pairing import Pairing, Sweep
from edge.replay.replay import Replay
from pipeline.products.tiles import TileStore
from pipeline.products.track import TrackWriter
from pipeline.refinement.submaps import SubmapWriter

TRACK, FIXES, TILES, FACTS = "odometry.track", "fixes.msgpack", "tiles", "odometry.json"
SUBMAPS = "submaps"
_DEPTH = 4
"""Sweeps decoded ahead: 2 MB."""


class OdometryFacts(msgspec.Struct):
    """What happened, for the products and for people."""

    sweeps: int = 0
    estimates: int = 0
    degenerate: int = 0
    fixes: int = 0
    seconds: float = 0.0
    """Of work."""
    late_scans: int = 0
    late_samples: int = 0
    refusals: dict[str, int] = {}
    """What the odometry said where it gave no estimate, and how often."""
    notes: tuple[str, ...] = ()
    damages: tuple[str, ...] = ()
    host_offset_ns: int | None = None
    """Session time minus the recording computer's monotonic time; None in recordings of others."""
    operator: str = ""
    voxel_m: float = 0.0
    """Of the tiles; 0: an earlier version did not say."""


@dataclass(frozen=True, slots=True)
class _Clouds:
    tiles: TileStore
    submaps: SubmapWriter

    def close(self) -> None:
        self.tiles.close()
        self.submaps.close()


@dataclass(frozen=True, slots=True)
class OdometryStage:
    """Bounded memory: the estimators', the tiles', and a few sweeps."""

    replay: Replay
    odometry: Odometry
    products: Products
    gnss: bool

    def run(self, folder: Path, advance: Callable[[float], None]) -> OdometryFacts:
        """advance: told the share that is done."""
        facts, started_s = OdometryFacts(), time.monotonic()
        products = self.products
        store = TileStore(folder / TILES, products.tile_m, products.voxel_m, products.memory_mib << 20)
        kept = _Clouds(store, SubmapWriter(folder / SUBMAPS))
        pairing = Pairing()
        fixes: list[GnssFix] = []
        with TrackWriter(folder / TRACK) as track:
            for item in ahead(self._items(pairing), _DEPTH):
                if isinstance(item, GnssFix):
                    fixes.append(item)
                    continue
                facts.sweeps += 1
                if not self._keep(self.odometry.process(item), track, kept, facts) and (note := self.odometry.note):
                    facts.refusals[note] = facts.refusals.get(note, 0) + 1
                if facts.sweeps % 10 == 0:
                    advance(facts.sweeps / max(self.replay.scans, 1))
            self._keep(self.odometry.flush(), track, kept, facts)
        kept.close()
        (folder / FIXES).write_bytes(msgspec.msgpack.encode(fixes))
        facts.fixes = len(fixes)
        facts.late_scans, facts.late_samples = pairing.left.scans, pairing.left.samples
        facts.notes, facts.damages = self.replay.notes, self.replay.damages
        facts.host_offset_ns = _host_offset_ns(self.replay.facts)
        facts.operator, facts.voxel_m = self.replay.facts.get("operator", ""), products.voxel_m
        facts.seconds = time.monotonic() - started_s
        (folder / FACTS).write_bytes(msgspec.json.encode(facts))
        return facts

    def _items(self, pairing: Pairing) -> Iterator[Sweep | GnssFix]:
        for message in self.replay.messages(gnss=self.gnss):
            if isinstance(message, GnssFix):
                yield message
            else:
                yield from pairing.add(message)
        yield from pairing.flush()

    @staticmethod
    def _keep(found: Iterable[Tracked], track: TrackWriter, clouds: _Clouds, facts: OdometryFacts) -> bool:
        """Whether there was any."""
        before = facts.estimates
        for one in found:
            track.add(one.estimate)
            clouds.tiles.add(one.cloud, facts.estimates)
            clouds.submaps.add(one.estimate, one.cloud, facts.estimates)
            facts.estimates += 1
            facts.degenerate += one.estimate.degenerate
        return facts.estimates > before


def _host_offset_ns(facts: dict[str, str]) -> int | None:
    try:
        return int(facts["anchor_utc_ns"]) - int(facts["anchor_monotonic_ns"])
    except (KeyError, ValueError):
        return None


def read_fixes(path: Path) -> list[GnssFix]:
    """In order of arrival."""
    return msgspec.msgpack.decode(path.read_bytes(), type=list[GnssFix])
