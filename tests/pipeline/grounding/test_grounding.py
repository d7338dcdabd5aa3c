"""Walks past small groves: who is found, where, how sure, and who is not."""

import numpy as np
import pytest

from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.grounding import Grounding, target_boxes
from tests.pipeline.grounding.grove import Grove, Trunk, looking

TRUNKS = [
    *(Trunk(2, 4, target=True), Trunk(5, 6, target=True, radius=0.2), Trunk(6.2, 6.5, target=True)),
    *(Trunk(0, 7), Trunk(8, 3), Trunk(10, 8, target=True, crown_from=1.5)),
]


def walked(grove, **settings):
    grounding = Grounding(grove, GroundingConfig(**settings))
    for view, detections in grove.walk():
        grounding.look(view, detections)
    return grounding


def found(trees):
    return [tree for tree in trees if tree.probability > 0.5]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_targets_are_found_and_nothing_else(seed):
    trees = found(walked(Grove(TRUNKS, seed=seed, recall=0.8, lies=0.2)).trees())
    targets = np.array([[trunk.x, trunk.y] for trunk in TRUNKS if trunk.target])
    away = np.linalg.norm(targets[:, None] - np.array([tree.position_m[:2] for tree in trees]), axis=2)
    assert len(trees) == 4
    assert away.min(axis=1).max() < 0.8
    assert {int(k) for k in away.argmin(axis=1)} == {0, 1, 2, 3}


def test_places_are_as_good_as_they_say():
    squared = []
    for seed in range(4):
        for tree in found(walked(Grove(TRUNKS, seed=seed, recall=0.8)).trees()):
            away = min(
                (tree.position_m[:2] - (trunk.x, trunk.y) for trunk in TRUNKS), key=lambda d: float(np.linalg.norm(d))
            )
            squared.append(away @ np.linalg.solve(tree.covariance[:2, :2], away))
            assert abs(tree.position_m[2]) < 0.3
    assert np.mean(np.array(squared) < 5.99) > 0.85


def test_lies_alone_are_no_trees():
    assert not found(walked(Grove([Trunk(2, 4), Trunk(5, 6), Trunk(8, 3)], lies=0.4)).trees())


def test_a_tree_says_how_often_it_was_seen_and_where_best():
    first = found(walked(Grove(TRUNKS)).trees())[0]
    assert first.hits <= first.views
    assert first.stem_seen
    assert 5.0 < first.height_m < 9.0
    assert first.points > 100
    assert len(first.best) > 1
    ranges = [view.range_m / view.confidence for view in first.best]
    assert ranges == sorted(ranges)
    assert np.diff(sorted(view.stamp_ns for view in first.best)).min() >= 1_500_000_000


def test_the_heat_is_on_the_targets_and_not_on_the_others():
    grounding = walked(Grove(TRUNKS, recall=0.9))
    for trunk in TRUNKS[:5]:
        stem = np.array([[trunk.x + trunk.radius * np.cos(a), trunk.y + trunk.radius * np.sin(a), z]
                         for a in np.linspace(0, 6, 12) for z in np.arange(0.8, 2.8, 0.1)])  # fmt: skip
        heat = grounding.evidence.at(stem)
        strongest = float(heat.log_odds[heat.seen > 0].max())
        assert (strongest > 1.0) == trunk.target


def test_without_a_map_around_nothing_is_said():
    grove = Grove(TRUNKS)
    grove.points = grove.points[:0]
    grounding = walked(grove)
    assert grounding.trees() == []
    assert grounding.counts.blind == grounding.counts.views > 0


def test_only_the_class_that_is_mapped_counts():
    view, detections = next(iter(Grove(TRUNKS).walk()))
    assert target_boxes(detections, "sumac") == []
    assert len(target_boxes(detections, "tree-of-heaven")) == len(target_boxes(detections, "")) == len(detections)
    assert view.stamp_ns == detections.stamp_ns


def test_a_box_into_the_sky_is_counted_and_put_nowhere():
    grove = Grove([])
    grounding = Grounding(grove, GroundingConfig())
    detections = Grove([], lies=5.0).detections(looking(0, 0, 0), np.random.default_rng(1))
    detections.boxes_px[:, [1, 3]] = [0.0, 60.0]
    grounding.look(looking(0, 0, 0), detections)
    assert grounding.counts.unplaced == grounding.counts.boxes == len(detections) > 0
    assert grounding.trees() == []
