"""A walk past a grove, as the stages before leave it: trees, what was searched, and evidence by point."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from edge.process import detections_file, fusion_stage, odometry_stage
from edge.process.detections_file import DetectionFacts, ModelFacts, write_detections
from edge.process.findings import read_findings, read_grounding
from edge.process.fusion_stage import write_placement
from edge.process.grounding_stage import GroundingStage
from edge.process.places import Places
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.views import CameraRig
from pipeline.products.tiles import TileStore, read_tile, tiles
from pipeline.products.track import ESTIMATE, Placement
from tests.pipeline.grounding.grove import CAMERA, Grove, Trunk

TILE_M = 16.0
TRUNKS = [Trunk(2, 4, target=True), Trunk(5, 6, target=True, radius=0.2), Trunk(0, 7), Trunk(8, 3)]
LATE_S = 0.1
LATE_NS = round(LATE_S * 1e9)
RIG = CameraRig(CAMERA, np.eye(3), np.zeros(3), late_s=LATE_S)
MODEL = ModelFacts("toh", "abc", ("tree-of-heaven",), "cpu", 0.35, 0.5)


@pytest.fixture
def work(tmp_path):
    grove = Grove(TRUNKS)
    for name in ("odometry", "fusion", "detection", "grounding"):
        (tmp_path / name).mkdir()
    store = TileStore(tmp_path / "odometry" / odometry_stage.TILES, TILE_M, 0.02)
    cloud = np.column_stack([grove.points, np.full(len(grove.points), 20.0)]).astype(np.float32)
    store.add(cloud, 0)
    store.close()
    views, found = zip(*grove.walk(every_m=0.2), strict=True)
    track = np.zeros(len(views), ESTIMATE)
    for k, view in enumerate(views):  # ten a second
        track[k]["stamp_ns"], track[k]["position_m"], track[k]["rotation"] = k * 10**8, view.position_m, view.rotation
        track[k]["covariance"] = 0.01 * np.eye(6)
    track.tofile(tmp_path / "odometry" / odometry_stage.TRACK)
    frames = [replace(one, stamp_ns=k * 10**8 + LATE_NS) for k, one in enumerate(found)][::3]
    write_detections(tmp_path / "detection" / detections_file.DETECTIONS, MODEL, "/cam", frames)
    facts = DetectionFacts(MODEL, len(frames))
    (tmp_path / "detection" / detections_file.FACTS).write_bytes(msgspec.json.encode(facts))
    return tmp_path


def run(work, **settings):
    stage = GroundingStage(Places.of(work), RIG, TILE_M, GroundingConfig(**settings))
    return stage.run(work / "grounding", lambda _: None), read_findings(Places.of(work), 0.5)


def test_trees_are_found_and_what_was_searched_is_told(work):
    trees, findings = run(work)
    assert len([tree for tree in trees if tree.probability > 0.5]) == len(findings.trees) == 2
    assert {tree.frame for tree in trees} == {findings.frame} == {"odom"}
    for place in ((2, 4), (5, 6)):
        assert min(np.linalg.norm(tree.position_m[:2] - place) for tree in findings.trees) < 0.6
    passed, never = findings.coverage.sample(np.array([[2.0, 3.0], [-20.0, -20.0]])).views
    assert passed > 5
    assert never == 0
    assert (findings.model.name, findings.images) == ("toh", len(range(0, 100, 3)))


def test_points_of_the_map_carry_the_evidence(work):
    _, findings = run(work)
    points = np.concatenate([read_tile(work / "odometry" / odometry_stage.TILES, tile, 0.02)
                             for tile in tiles(work / "odometry" / odometry_stage.TILES)])  # fmt: skip
    told = findings.evidence((0, 0), points)
    near = np.linalg.norm(points["xyz"][:, :2] - (2, 4), axis=1) < 0.3
    other = np.linalg.norm(points["xyz"][:, :2] - (8, 3), axis=1) < 0.3
    assert told.label[near & (told.seen > 3)].mean() > 0.8
    assert told.label[other].mean() < 0.1
    assert (told.probability[other & (told.seen > 3)] < 0.2).mean() > 0.9


def test_a_placed_session_has_its_trees_and_its_searched_area_in_the_map(work):
    poses = len(np.fromfile(work / "odometry" / odometry_stage.TRACK, ESTIMATE))
    shift = np.array([100.0, -50.0, 7.0])
    covariance = np.tile(0.25 * np.eye(6), (poses, 1, 1))
    placement = Placement.upright((47.0, 8.0, 500.0), np.tile(shift, (poses, 1)), np.full(poses, np.pi / 2), covariance)
    local, _ = run(work)
    write_placement(work / "fusion" / fusion_stage.PLACEMENT, placement)
    trees, findings = run(work)
    x, y, z = local[0].position_m
    np.testing.assert_allclose(trees[0].position_m, np.array([-y, x, z]) + shift)
    assert trees[0].covariance[0, 0] > 0.25
    assert findings.frame == "map"
    west, _, _, north = findings.coverage.bounds_m()
    assert west > 70
    assert north < 0
    assert findings.coverage.sample(trees[0].position_m[None, :2]).probability[0] > 0.9


def test_a_class_the_model_does_not_know_maps_nothing_and_says_so(work):
    trees, findings = run(work, target="oak")
    assert not trees
    assert not findings.trees
    assert "knows tree-of-heaven; nothing was mapped" in read_grounding(Places.of(work)).notes[0]


def test_images_without_a_pose_or_of_another_lens_are_counted(work):
    path = work / "detection" / detections_file.DETECTIONS
    _, frames = detections_file.read_detections(path)
    lost = [replace(frames[0], stamp_ns=10**12), replace(frames[5], width_px=640, stamp_ns=frames[5].stamp_ns + 1)]
    write_detections(path, MODEL, "/cam", [*frames, *lost])
    run(work)
    facts = read_grounding(Places.of(work))
    assert facts.lost == 3  # and the first, which is before any pose
    assert facts.views == len(frames) - 1
    assert "3 images were left out" in facts.notes[0]
