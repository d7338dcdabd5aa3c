"""Pictures and boxes on disk: a folder a walk, with JPEG files and one table of boxes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from drivers.sim.boxes import TreeBoxes
from training.demo_detector.walks import Shot

TABLE = "boxes.npz"
QUALITY = 95


@dataclass(frozen=True, eq=False)
class Picture:
    """A file, and the trees that are really in it."""

    path: Path
    boxes: TreeBoxes


def write(shots: Iterable[Shot], folder: Path) -> int:
    """One walk; the table comes last, so that a folder with one is whole. Number of pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    frames, tables = [], []
    for shot in shots:
        picture = cv2.cvtColor(shot.picture, cv2.COLOR_RGB2BGR)
        cv2.imwrite(str(folder / f"{shot.frame:06d}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        frames.append(np.full(len(shot.boxes), shot.frame))
        tables.append(shot.boxes)
    columns = {name: np.concatenate([getattr(table, name) for table in tables]) for name in TreeBoxes.__slots__}
    np.savez(folder / TABLE, frame=np.concatenate(frames), **columns)
    return len(tables)


def walks(folder: Path) -> list[Path]:
    """The walks under a folder that are whole, in order."""
    return sorted(table.parent for table in folder.glob(f"*/{TABLE}"))


def pictures(walk: Path) -> list[Picture]:
    """Of one walk, in order."""
    with np.load(walk / TABLE) as columns:
        frame = columns["frame"]
        boxes = TreeBoxes(**{name: columns[name] for name in TreeBoxes.__slots__})
    return [Picture(path, boxes[frame == int(path.stem)]) for path in sorted(walk.glob("*.jpg"))]
