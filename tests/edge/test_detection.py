"""The model that comes along knows the simulated forest, says that it knows no other, and is small."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.sim.boxes import Annotation, tree_boxes
from drivers.sim.camera import Camera, exposure_ns
from drivers.sim.renderer import Renderer
from drivers.sim.scenarios import scenario
from drivers.sim.species import Species
from drivers.sim.world import build
from edge.detection import DEMO_MODEL
from pipeline.detection.detector import Detector, Settings
from pipeline.detection.layout import Layout
from pipeline.evaluation.matching import match, overlaps

pytest.importorskip("onnxruntime", reason="the detector's runtime is an extra")

SEED = 40
"""Neither of the demo and evaluation, nor trained on, nor of the model card."""
WITH, WITHOUT = (640, 700, 760), (400, 460, 520)
"""Frames of its walk with Tree-of-Heaven in sight, and with other trees only."""


@pytest.fixture(scope="module")
def detector():
    return Detector(DEMO_MODEL, Settings(device="cpu", threads=1))


@pytest.fixture(scope="module")
def filmed():
    """By frame, the picture in BGR and the trees in it."""
    world = build(replace(scenario("open_trail", SEED), length_m=40.0))
    renderer = Renderer(world.scene, world.trajectory, Camera(), SEED)
    shots = {}
    for frame in WITH + WITHOUT:
        picture = np.ascontiguousarray(renderer.render(exposure_ns(frame))[..., ::-1])
        shots[frame] = picture, tree_boxes(renderer, world.trees, within_m=20.0)
    return shots


def test_it_is_of_the_layout_stated_and_for_demonstration_only(detector):
    info = detector.info
    assert (info.layout, info.input_px, info.class_names) == (Layout.ROWS, (256, 416), ("tree-of-heaven",))
    assert "for demonstration only" in info.notice
    assert 0.0 < detector.confidence == info.advised < 1.0
    assert DEMO_MODEL.stat().st_size < 4e6


@pytest.mark.parametrize("frame", WITH)
def test_it_finds_trees_it_has_never_seen(detector, filmed, frame):
    picture, boxes = filmed[frame]
    rule = Annotation(within_m=10.0, visible_px=2000, visible_share=0.5)
    near = boxes[rule.counts(boxes) & (boxes.species == Species.TREE_OF_HEAVEN)]
    found = match(overlaps(detector.detect(picture, 0).boxes_px, near.boxes_px), 0.5) >= 0
    assert found.sum() >= max(1, len(near) // 2)


@pytest.mark.parametrize("frame", WITHOUT)
def test_it_finds_nothing_where_only_other_trees_stand(detector, filmed, frame):
    picture, boxes = filmed[frame]
    assert len(boxes) > 0
    assert not (boxes.species == Species.TREE_OF_HEAVEN).any()
    assert len(detector.detect(picture, 0)) == 0
