"""A session's map once more, with smaller voxels, for diameters; kept beside the first, whose products stay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from edge.config import Config
from edge.errors import EdgeError
from edge.process.checkpoint import Checkpoint, alone, key_of
from edge.process.estimators import Estimators, estimators, odometry_config
from edge.process.odometry_stage import TRACK, OdometryStage
from edge.process.places import Places
from edge.process.watch import Watch
from edge.replay.replay import Replay
from pipeline.products.track import read_track

FINE_M = 0.02
"""Voxels, those that the figures of docs/inventory.md are for."""
STAGE = "fine"
_APART_M = 0.005
"""Two runs of the odometry are one to rounding."""


def fine_map(
    recording: Sequence[Path],
    places: Places,
    config: Config,
    watch: Watch,
    load: Callable[[], Estimators] = estimators,
) -> Path:
    """The folder of the odometry, as the stage leaves it. Placements of the first run hold for it.

    EdgeError where there is no recording, or the odometry goes another way than the first time.
    """
    if not recording:
        raise EdgeError("the recording is not beside its products: a map cannot be made without it")
    work = places.odometry.parent
    with alone(work):
        checkpoint = Checkpoint(work)
        key = key_of(checkpoint.key("odometry"), FINE_M)
        done = checkpoint.done(STAGE, key)
        watch.stage("fine map", done=done)
        if not done:
            replay = Replay(recording, config)
            odometry = load().odometry(odometry_config(config, replay.geometry))
            products = msgspec.structs.replace(config.products, voxel_m=FINE_M)
            OdometryStage(replay, odometry, products, gnss=False).run(checkpoint.begin(STAGE), watch.advance)
            _check(work / STAGE, places.odometry)
            checkpoint.finish(STAGE, key)
    return work / STAGE


def _check(fine: Path, first: Path) -> None:
    ways = [read_track(folder / TRACK)["position_m"] for folder in (fine, first)]
    if len(ways[0]) != len(ways[1]) or np.abs(ways[0] - ways[1]).max(initial=0.0) > _APART_M:
        raise EdgeError(
            f"{first.parent}: mapped once more, the odometry went another way than the first time: by other settings, "
            f"or of another version. Process the recording again, with products.voxel_m = {FINE_M:g}"
        )
