"""Which found box is which true one, and how precise a detector is at every recall, as COCO counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
IOUS = np.linspace(0.5, 0.95, 10)
"""Of AP50-95; the first is the one of the operating point."""
RECALLS = np.linspace(0.0, 1.0, 101)
MOST = 100
"""Boxes of one class that count in an image."""


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Of one class over n images, k found boxes in all, in order of confidence (equal ones in order of images).

    image: (k,) index. confidence: (k,). hit: (10, k), whether it is a true one at each of IOUS. truths: (n,) how many
    there are to find.
    """

    image: npt.NDArray[np.int64]
    confidence: Array
    hit: Bools
    truths: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """(k,) precision and recall with everything at least that sure."""

    confidence: Array
    precision: Array
    recall: Array


def overlaps(one: Array, other: Array) -> Array:
    """(n, m) intersection over union of boxes (n, 4) and (m, 4)."""
    low = np.maximum(one[:, None, :2], other[None, :, :2])
    high = np.minimum(one[:, None, 2:], other[None, :, 2:])
    both = np.prod(np.maximum(high - low, 0.0), axis=2)
    area = [np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) for boxes in (one, other)]
    union = area[0][:, None] + area[1][None] - both
    return np.asarray(np.divide(both, union, out=np.zeros_like(both), where=union > 0))


def match(overlap: Array, iou: float) -> npt.NDArray[np.int64]:
    """(n,) which of the m true boxes each of n found ones takes, surest first, by overlap (n, m); -1 for none left."""
    free = overlap.copy()
    found, true = free.shape
    taken = np.full(found, -1, np.int64)
    for row in range(found if true else 0):
        best = true - 1 - int(free[row, ::-1].argmax())  # of equals the last, as COCO does
        if free[row, best] >= iou:
            taken[row] = best
            free[:, best] = -1.0
    return taken


def gather(per_image: list[tuple[Array, Array, Array]]) -> Matches:
    """Of one class. per_image: found boxes, their confidences, true boxes of each image."""
    images, confidences, hits = [], [], []
    for index, (found, confidence, true) in enumerate(per_image):
        order = np.argsort(-confidence, kind="stable")[:MOST]
        images.append(np.full(len(order), index))
        confidences.append(confidence[order])
        overlap = overlaps(found[order], true)
        hits.append(np.array([match(overlap, iou) >= 0 for iou in IOUS]).reshape(len(IOUS), -1))
    confidence = np.concatenate([*confidences, np.empty(0)])
    order = np.argsort(-confidence, kind="stable")
    truths = np.array([len(true) for _, _, true in per_image], np.int64)
    image = np.concatenate([*images, np.empty(0)]).astype(np.int64)
    hit = np.concatenate([*hits, np.empty((len(IOUS), 0), bool)], axis=1).astype(bool)
    return Matches(image[order], confidence[order], hit[:, order], truths)


def average_precision(matches: Matches, counts: npt.NDArray[np.int64] | None = None, levels: int = len(IOUS)) -> Array:
    """(levels,) at the first of IOUS, interpolated at 101 recalls; NaN where there is nothing to find.

    counts: (n,) how often each image counts, for resampling.
    """
    weight = np.ones(len(matches.truths), np.int64) if counts is None else counts
    positives = int(weight @ matches.truths)
    if not positives:
        return np.full(levels, np.nan)
    each = weight[matches.image]
    found = np.cumsum(each)
    precisions = []
    for hit in matches.hit[:levels]:
        true = np.cumsum(each * hit)
        precision = np.divide(true, found, out=np.zeros(len(found)), where=found > 0)
        best = np.maximum.accumulate(precision[::-1])[::-1]
        at = np.searchsorted(true / positives, RECALLS)
        precisions.append(np.concatenate([best, [0.0]])[np.minimum(at, len(best))].mean())
    return np.array(precisions)


def curve(matches: Matches) -> Curve:
    """At the IoU of the operating point."""
    true = np.cumsum(matches.hit[0])
    precision = true / np.arange(1, len(true) + 1)
    recall = true / max(int(matches.truths.sum()), 1)
    return Curve(matches.confidence, precision, recall)
