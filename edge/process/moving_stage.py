"""After the placement: which points of the map are of what moved. They stay in the tiles, and out of the products."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from edge.process import fusion_stage, odometry_stage
from edge.process.fusion_stage import read_placement
from edge.process.places import Places
from pipeline.products.tiles import Tile
from pipeline.products.track import read_track
from pipeline.refinement.config import MovingConfig
from pipeline.refinement.submaps import read_submaps

MOVED = "moved.npz"


def find_moved(
    places: Places, voxel_m: float, config: MovingConfig, folder: Path, advance: Callable[[float], None]
) -> None:
    """Written into `folder`: a bit a point, tile after tile."""
    from pipeline.refinement.moving import Seen, moved  # noqa: PLC0415 - numba takes a second

    placement = read_placement(places.fusion / fusion_stage.PLACEMENT)
    assert placement is not None
    odometry = places.odometry
    track, submaps = read_track(odometry / odometry_stage.TRACK), read_submaps(odometry / odometry_stage.SUBMAPS)
    seen = Seen(odometry / odometry_stage.TILES, voxel_m, track, placement, submaps)
    with tempfile.TemporaryDirectory(dir=folder) as work:
        found = moved(seen, config, Path(work), advance)
    counts = np.array([(*tile, len(mask)) for tile, mask in found.items()], np.int64)
    np.savez(folder / MOVED, counts=counts, bits=np.packbits(np.concatenate([*found.values(), np.empty(0, np.bool_)])))


def read_moved(path: Path | None) -> dict[Tile, npt.NDArray[np.bool_]] | None:
    """None where nobody looked."""
    if path is None or not path.exists():
        return None
    with np.load(path) as found:
        counts = found["counts"].reshape(-1, 3)
        masks = np.split(np.unpackbits(found["bits"], count=int(counts[:, 2].sum())), np.cumsum(counts[:-1, 2]))
    return {(x, y): mask.astype(np.bool_) for (x, y, _), mask in zip(counts.tolist(), masks, strict=False)}
