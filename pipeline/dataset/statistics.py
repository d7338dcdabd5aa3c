"""What a dataset holds: by split, source and site; how large the boxes are; how sharp the images."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from pipeline.dataset.labels import Box
from pipeline.dataset.record import ImageRecord

NETWORK_PX = 832
"""Boxes are measured as the detector sees them: the longer side of the image at this size."""
SMALL_PX, LARGE_PX = 32.0, 96.0
"""Roots of areas between which COCO calls a box medium."""


class Share(msgspec.Struct):
    """Of the images with something in common. negatives: looked at, and nothing is there."""

    images: int = 0
    labelled: int = 0
    negatives: int = 0
    boxes: int = 0
    per_class: dict[str, int] = {}


class Sizes(msgspec.Struct):
    """Of the boxes, in pixels of a network of `NETWORK_PX`."""

    small: int = 0
    medium: int = 0
    large: int = 0
    smallest_px: float = 0.0
    median_px: float = 0.0
    largest_px: float = 0.0


class Statistics(msgspec.Struct):
    """The whole."""

    total: Share
    by_split: dict[str, Share]
    by_source: dict[str, Share]
    by_site: dict[str, Share]
    sizes: Sizes
    boxes_per_image: dict[int, int]
    """Boxes -> labelled images with so many."""
    sharpness: dict[str, tuple[float, float, float]]
    """Source -> quartiles."""
    licences: dict[str, int]
    non_commercial: int


def statistics(
    records: Sequence[ImageRecord], labels: Sequence[Sequence[Box] | None], classes: Sequence[str]
) -> Statistics:
    """labels: of each image, None where nobody has looked."""

    def by(key: Callable[[ImageRecord], str]) -> dict[str, Share]:
        names = [key(record) for record in records]
        return {
            name: _share([one for one, own in zip(labels, names, strict=True) if own == name], classes)
            for name in sorted(set(names))
        }

    return Statistics(
        total=_share(labels, classes),
        by_split=by(lambda record: record.split or "none"),
        by_source=by(lambda record: record.source),
        by_site=by(lambda record: record.site or "none"),
        sizes=_sizes(records, labels),
        boxes_per_image=dict(sorted(Counter(len(one) for one in labels if one is not None).items())),
        sharpness=_sharpness(records),
        licences=dict(Counter(record.licence or "own" for record in records).most_common()),
        non_commercial=sum(record.non_commercial for record in records),
    )


def _share(labels: Sequence[Sequence[Box] | None], classes: Sequence[str]) -> Share:
    looked_at = [one for one in labels if one is not None]
    counts = Counter(classes[box.class_id] for boxes in looked_at for box in boxes)
    return Share(
        images=len(labels),
        labelled=len(looked_at),
        negatives=sum(1 for boxes in looked_at if not boxes),
        boxes=counts.total(),
        per_class={name: counts[name] for name in classes},
    )


def _sizes(records: Sequence[ImageRecord], labels: Sequence[Sequence[Box] | None]) -> Sizes:
    found = []
    for record, boxes in zip(records, labels, strict=True):
        scale = NETWORK_PX / max(record.width_px, record.height_px)
        found += [scale * (b.w * record.width_px * b.h * record.height_px) ** 0.5 for b in boxes or ()]
    if not found:
        return Sizes()
    px = np.array(found)
    small, large = int((px < SMALL_PX).sum()), int((px > LARGE_PX).sum())
    return Sizes(small, len(px) - small - large, large, float(px.min()), float(np.median(px)), float(px.max()))


def _sharpness(records: Sequence[ImageRecord]) -> dict[str, tuple[float, float, float]]:
    quartiles = {}
    for source in sorted({record.source for record in records}):
        values = [r.sharpness for r in records if r.source == source and r.sharpness is not None]
        if values:
            low, middle, high = np.percentile(values, (25, 50, 75)).tolist()
            quartiles[str(source)] = (low, middle, high)
    return quartiles
