"""Between detection and products: what the images showed, put on the map."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from edge.process import odometry_stage
from edge.process.detections_file import DETECTIONS, read_detections
from edge.process.trees_file import EVIDENCE, FACTS, TREES, GroundingFacts, write_trees
from pipeline.detections import FrameDetections
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.grounding import Grounding
from pipeline.grounding.sources import TilePoints
from pipeline.grounding.views import CameraRig, CameraView, Pose, camera_view
from pipeline.products.track import read_track

POINTS_M = 0.1
"""One point in a cube of this size shows what hides what."""


@dataclass(frozen=True, slots=True)
class GroundingStage:
    """odometry, detection: the folders of those stages. tile_m: of the odometry's tiles."""

    odometry: Path
    detection: Path
    rig: CameraRig
    tile_m: float
    config: GroundingConfig

    def run(self, folder: Path, advance: Callable[[float], None]) -> GroundingFacts:
        """Write trees in `odom`, and the evidence by point."""
        started_s = time.monotonic()
        track = read_track(self.odometry / odometry_stage.TRACK)
        model, frames = read_detections(self.detection / DETECTIONS)
        target = self.config.target or (model.class_names[0] if model.class_names else "")
        facts = GroundingFacts(target)
        if target not in model.class_names:
            known = ", ".join(model.class_names)
            facts.notes += (f"grounding.target {target!r}: the model {model.name} knows {known}; nothing was mapped",)
        config = msgspec.structs.replace(self.config, target=target)
        tiles = TilePoints(self.odometry / odometry_stage.TILES, self.tile_m, POINTS_M)
        grounding = Grounding(tiles, config)
        for k, frame in enumerate(frames):
            view = self._view(track, frame)
            if view is None:
                facts.lost += 1
            else:
                grounding.look(view, frame)
            if k % 20 == 0:
                advance(k / len(frames))
        self._finish(grounding, folder, facts)
        facts.seconds = time.monotonic() - started_s
        (folder / FACTS).write_bytes(msgspec.json.encode(facts))
        return facts

    def _finish(self, grounding: Grounding, folder: Path, facts: GroundingFacts) -> None:
        trees = grounding.trees()
        write_trees(folder / TREES, trees)
        assert grounding.evidence is not None
        grounding.evidence.save(folder / EVIDENCE)
        counts = grounding.counts
        facts.views, facts.blind, facts.boxes, facts.unplaced = (
            counts.views,
            counts.blind,
            counts.boxes,
            counts.unplaced,
        )
        facts.trees = sum(tree.probability >= self.config.probable for tree in trees)
        if facts.lost:
            facts.notes += (
                f"{facts.lost} images were left out: no pose at their time, or not of the calibrated shape "
                f"({self.rig.model.width_px} x {self.rig.model.height_px})",
            )
        if facts.blind:
            facts.notes += (f"{facts.blind} images with no LiDAR points around were left out",)

    def _view(self, track: npt.NDArray[np.void], frame: FrameDetections) -> CameraView | None:
        exposed_ns = frame.stamp_ns - round(self.rig.late_s * 1e9)
        after = int(np.searchsorted(track["stamp_ns"], exposed_ns))
        if not 0 < after < len(track):
            return None
        before, behind = (_pose(track[k]) for k in (after - 1, after))
        rig = self.rig.for_images(frame.width_px, frame.height_px)
        return camera_view(frame.stamp_ns, before, behind, rig) if rig is not None else None


def _pose(record: np.void) -> Pose:
    return Pose(int(record["stamp_ns"]), record["rotation"], record["position_m"])
