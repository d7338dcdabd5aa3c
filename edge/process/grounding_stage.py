"""Between detection and products: what the images showed, put on the map."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from edge.process import fusion_stage, odometry_stage
from edge.process.camera_way import CameraWay
from edge.process.clocks import apart
from edge.process.detections_file import DETECTIONS, read_detections
from edge.process.fusion_stage import read_placement
from edge.process.places import Places
from edge.process.trees_file import EVIDENCE, FACTS, SEARCHED, TREES, GroundingFacts, write_trees
from pipeline.detections import FrameDetections
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.grounding import Grounding
from pipeline.grounding.sources import TilePoints
from pipeline.grounding.views import CameraRig
from pipeline.products.coverage import CoverageGrid
from pipeline.products.track import read_track
from pipeline.trees import Tree

Array = npt.NDArray[np.float64]
POINTS_M = 0.1
"""One point in a cube of this size shows what hides what."""


@dataclass(frozen=True, slots=True)
class GroundingStage:
    """tile_m: of the odometry's tiles."""

    places: Places
    rig: CameraRig
    tile_m: float
    config: GroundingConfig

    def run(self, folder: Path, advance: Callable[[float], None]) -> list[Tree]:
        """Write trees and what was searched, in the frame of the placement, else in `odom`; and the
        evidence by point of the odometry's map. Returns the trees."""
        started_s = time.monotonic()
        model, frames = read_detections(self.places.detection / DETECTIONS)
        target = self.config.target or (model.class_names[0] if model.class_names else "")
        placement = read_placement(self.places.fusion / fusion_stage.PLACEMENT)
        facts = GroundingFacts(target, "odom" if placement is None else placement.frame)
        if target not in model.class_names:
            known = ", ".join(model.class_names)
            facts.notes += (f"grounding.target {target!r}: the model {model.name} knows {known}; nothing was mapped",)
        odometry = self.places.odometry
        tiles = TilePoints(odometry / odometry_stage.TILES, self.tile_m, POINTS_M)
        grounding = Grounding(tiles, msgspec.structs.replace(self.config, target=target))
        track = read_track(odometry / odometry_stage.TRACK)
        where = CameraWay(track, placement, self.rig)
        searched = _Searched(grounding, where)
        for k, frame in enumerate(frames):
            facts.lost += not searched.look(frame)
            if k % 20 == 0:
                advance(k / len(frames))
        trees = where.placed(grounding.trees())
        write_trees(folder / TREES, trees)
        searched.write(folder)
        self._count(facts, grounding, trees)
        late_ns = round(1e9 * self.rig.late_s)
        off = apart(np.array([frame.stamp_ns for frame in frames], np.int64) - late_ns, track["stamp_ns"])
        if off:
            facts.notes += (
                f"of the images {off}; timing.camera_late_s of the calibration takes off what they are late",
            )
        facts.seconds = time.monotonic() - started_s
        (folder / FACTS).write_bytes(msgspec.json.encode(facts))
        return trees

    def _count(self, facts: GroundingFacts, grounding: Grounding, trees: list[Tree]) -> None:
        counts = grounding.counts
        facts.views, facts.blind, facts.boxes = counts.views, counts.blind, counts.boxes
        facts.unplaced = counts.unplaced
        facts.trees = sum(tree.probability >= self.config.probable for tree in trees)
        if facts.lost:
            facts.notes += (
                f"{facts.lost} images were left out: no pose at their time, or not of the calibrated shape "
                f"({self.rig.model.width_px} x {self.rig.model.height_px})",
            )
        if facts.blind:
            facts.notes += (f"{facts.blind} images with no LiDAR points around were left out",)


class _Searched:
    """Looks through a session's images, and keeps where they looked."""

    def __init__(self, grounding: Grounding, where: CameraWay) -> None:
        self._grounding = grounding
        self._where = where
        self._grid = CoverageGrid()
        self._sweeps = [0]
        """Of each view that the evidence has heard, which it counts from 1."""

    def look(self, frame: FrameDetections) -> bool:
        """False where the image cannot be put on the map."""
        where = self._where
        found = where.view(frame.stamp_ns, frame.width_px, frame.height_px)
        if found is None:
            return False
        view, sweep = found
        blind = self._grounding.counts.blind
        seen = self._grounding.look(view, frame)
        if self._grounding.counts.blind == blind:
            self._sweeps.append(sweep)
            self._grid.see(where.points(seen, np.full(len(seen), sweep)), where.sigma_m(sweep))
        return True

    def write(self, folder: Path) -> None:
        evidence = self._grounding.evidence
        assert evidence is not None
        middles, log_odds, last = evidence.voxels()
        self._grid.weigh(self._where.points(middles, np.array(self._sweeps)[last]), log_odds.astype(np.float64))
        evidence.save(folder / EVIDENCE)
        self._grid.save(folder / SEARCHED)
