"""Counts of a small dataset, against counting by hand."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.dataset.labels import Box
from pipeline.dataset.record import ImageRecord
from pipeline.dataset.statistics import statistics


def test_counts_sizes_and_quartiles():
    def record(name, **fields):
        return ImageRecord(image=name, sha256=name, width_px=1664, height_px=832, **fields)

    records = [
        record("a.jpg", source="field", site="wood", split="train", sharpness=10.0),
        record("b.jpg", source="field", site="wood", split="train", sharpness=30.0),
        record("c.jpg", source="field", site="moor", split="test", sharpness=20.0),
        record("d.jpg", source="inaturalist", licence="cc-by-nc", non_commercial=True),
    ]
    boxes = [Box(0, 0.5, 0.5, 0.1, 0.1), Box(1, 0.5, 0.5, 0.5, 1.0), Box(0, 0.5, 0.5, 0.01, 0.02)]
    found = statistics(records, [boxes, [], None, boxes[:1]], ["ailanthus", "sumac"])
    assert (found.total.images, found.total.labelled, found.total.negatives, found.total.boxes) == (4, 3, 1, 4)
    assert found.total.per_class == {"ailanthus": 3, "sumac": 1}
    assert found.by_split["train"].labelled == 2
    assert found.by_split["test"].labelled == 0
    assert found.by_site["wood"].boxes == 3
    assert found.by_source["inaturalist"].boxes == 1
    # at half size: 83.2 x 41.6, twice; 416 x 416; 8.32 x 8.32 pixels
    assert (found.sizes.small, found.sizes.medium, found.sizes.large) == (1, 2, 1)
    assert (found.sizes.smallest_px, found.sizes.largest_px) == pytest.approx((8.32, 416.0))
    assert found.sizes.median_px == pytest.approx(np.sqrt(83.2 * 41.6))
    assert found.boxes_per_image == {0: 1, 1: 1, 3: 1}
    assert found.sharpness["field"] == (15.0, 20.0, 25.0)
    assert found.licences == {"own": 3, "cc-by-nc": 1}
    assert found.non_commercial == 1


def test_an_empty_dataset_has_empty_statistics():
    found = statistics([], [], ["ailanthus"])
    assert found.total.images == 0
    assert found.sizes.median_px == 0.0
    assert found.by_site == {}
