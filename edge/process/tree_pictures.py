"""Pictures of the mapped trees, cut from the video."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from edge.config import Config
from edge.replay.frames import VideoFrames, video_topic
from edge.replay.store import MessageStore
from pipeline.trees import Tree

MARGIN = 0.15
"""Of the box's sides, around it."""
LEAST_PX = 96
_QUALITY = 90


def write_pictures(folder: Path, trees: Sequence[Tree], recording: Sequence[Path], config: Config) -> None:
    """`<tree_id>.jpg` of the best view of each; none of a tree whose image can no longer be decoded."""
    folder.mkdir(exist_ok=True)
    wanted: dict[int, list[Tree]] = {}
    for tree in trees:
        if tree.best:
            wanted.setdefault(tree.best[0].stamp_ns, []).append(tree)
    if not wanted:
        return
    store = MessageStore(recording)
    topic = video_topic(store.topics, store.recording.effective(config).topics)
    for frame in VideoFrames(store, topic).read(wanted.__contains__):
        for tree in wanted.get(frame.stamp_ns, ()):
            cut = crop(frame.image_bgr, tree.best[0].box_px)
            cv2.imwrite(str(folder / f"{tree.tree_id}.jpg"), cut, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])


def read_pictures(folder: Path) -> dict[int, Path]:
    """By `tree_id`."""
    return {int(path.stem): path for path in sorted(folder.glob("*.jpg"))}


def crop(image: npt.NDArray[np.uint8], box_px: tuple[float, float, float, float]) -> npt.NDArray[np.uint8]:
    """The box with a margin around it, as far as the image goes."""
    x0, y0, x1, y1 = box_px
    aside, above = max(MARGIN * (x1 - x0), 0.5 * (LEAST_PX - (x1 - x0))), MARGIN * (y1 - y0)
    height, width = image.shape[:2]
    left, right = max(int(x0 - aside), 0), min(int(np.ceil(x1 + aside)), width)
    top, bottom = max(int(y0 - above), 0), min(int(np.ceil(y1 + above)), height)
    return np.ascontiguousarray(image[top:bottom, left:right])
