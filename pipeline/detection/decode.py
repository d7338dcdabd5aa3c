"""From a model's output to boxes: what is sure enough, each thing once."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.detection.layout import BOX, Layout

MOST_CANDIDATES = 2000
"""The surest; a suppression of all 8400 at a confidence near zero takes half a second."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """boxes: (n, 4) x_min, y_min, x_max, y_max in pixels of the input. confidence, class_id: (n,), surest first."""

    boxes: npt.NDArray[np.float64]
    confidence: npt.NDArray[np.float64]
    class_id: npt.NDArray[np.int64]

    def chosen(self, which: npt.NDArray[np.intp]) -> Found:
        """Some of them."""
        return Found(self.boxes[which], self.confidence[which], self.class_id[which])


NOTHING = Found(np.empty((0, 4)), np.empty(0), np.empty(0, np.int64))


def decode(output: npt.NDArray[np.floating], layout: Layout, confidence: float) -> Found:
    """The boxes at least as sure as `confidence`, one class each, the best. output: as the model gave it."""
    found = _final(output[0], confidence) if layout is Layout.FINAL else _anchored(output[0], layout, confidence)
    if len(found.boxes) < 2:
        return found
    order = np.argsort(-found.confidence, kind="stable")
    return found.chosen(order[:MOST_CANDIDATES])


def suppress(found: Found, iou: float, most: int) -> Found:
    """Of boxes of one class that overlap by more than `iou`, the surest; at most `most` in all."""
    if len(found.boxes) > 1:
        corners = found.boxes[:, :2]
        sized = np.hstack([corners, found.boxes[:, 2:] - corners])
        kept = cv2.dnn.NMSBoxesBatched(sized.tolist(), found.confidence.tolist(), found.class_id.tolist(), 0.0, iou)
        found = found.chosen(np.sort(np.asarray(kept, np.int64).ravel()))
    return found.chosen(np.arange(min(most, len(found.boxes))))


def _anchored(output: npt.NDArray[np.floating], layout: Layout, confidence: float) -> Found:
    fields = output if layout is Layout.ROWS else output.T
    scores = fields[BOX:]
    if len(scores) == 1:
        kept = np.flatnonzero(scores[0] >= confidence)
        best = np.zeros(len(kept), np.int64)
    else:
        kept = np.flatnonzero((scores >= confidence).any(axis=0))
        best = scores[:, kept].argmax(axis=0)
    if not len(kept):  # most images of a forest: 0.2 ms less after a run that has emptied the caches
        return NOTHING
    cx, cy, width, height = fields[:BOX, kept].astype(np.float64)
    boxes = np.stack([cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2], axis=1)
    return Found(boxes, scores[best, kept].astype(np.float64), best)


def _final(rows: npt.NDArray[np.floating], confidence: float) -> Found:
    kept = rows[rows[:, 4] >= confidence].astype(np.float64)
    return Found(kept[:, :BOX], kept[:, 4], kept[:, 5].astype(np.int64))
