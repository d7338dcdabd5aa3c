from dataclasses import replace

import numpy as np
import pytest

from drivers.sim.boxes import Annotation, tree_boxes
from drivers.sim.camera import Camera, exposure_ns
from drivers.sim.renderer import Renderer
from drivers.sim.scenarios import scenario
from drivers.sim.species import Species
from drivers.sim.world import build

AWAY_M = np.array([5000.0, 0.0, 0.0], dtype=np.float32)


@pytest.fixture(scope="module")
def world():
    return build(replace(scenario("open_trail", 3), length_m=60.0))


@pytest.fixture(scope="module")
def renderer(world):
    renderer = Renderer(world.scene, world.trajectory, Camera(), world.config.seed)
    renderer.render(exposure_ns(500))
    return renderer


def without(scene, tree):
    """The same scene with one tree carried off: all other rows keep their numbers, and so their looks."""
    stem = np.where(np.arange(len(scene.trees)) == tree, 1.0, 0.0).astype(np.float32)[:, None] * AWAY_M
    wood = (scene.branches.tree == tree)[:, None] * AWAY_M
    leaves = (scene.foliage.tree == tree)[:, None] * AWAY_M
    return replace(
        scene,
        stems=replace(scene.stems, base_m=scene.stems.base_m + stem, top_m=scene.stems.top_m + stem),
        branches=replace(scene.branches, start_m=scene.branches.start_m + wood, end_m=scene.branches.end_m + wood),
        foliage=replace(scene.foliage, centre_m=scene.foliage.centre_m + leaves),
    )


def test_a_box_is_around_what_the_picture_loses_with_the_tree(world, renderer):
    boxes = tree_boxes(renderer, world.trees, within_m=15.0)
    assert len(boxes) >= 5
    bare = Renderer(world.scene, world.trajectory, Camera(), world.config.seed)
    for row, tree in enumerate(boxes.tree):
        bare._scene = without(world.scene, tree)
        bare._near_at[:] = np.inf
        bare.render(exposure_ns(500))
        lost = bare.depth_m > renderer.depth_m
        assert lost.sum() == pytest.approx(boxes.visible_px[row], abs=2)
        v, u = np.nonzero(lost)
        assert boxes.boxes_px[row] == pytest.approx([u.min(), v.min(), u.max() + 1, v.max() + 1], abs=1)


def test_what_is_hidden_is_missing_from_the_share(world, renderer):
    boxes = tree_boxes(renderer, world.trees)
    assert ((boxes.visible_share > 0.0) & (boxes.visible_share <= 1.0)).all()
    assert np.median(boxes.visible_share[boxes.range_m < 10.0]) > np.median(boxes.visible_share[boxes.range_m > 20.0])


def test_species_and_range_are_those_of_the_inventory(world, renderer):
    boxes = tree_boxes(renderer, world.trees, species=[Species.TREE_OF_HEAVEN])
    assert len(boxes) > 0
    assert (world.trees.species[boxes.tree] == Species.TREE_OF_HEAVEN).all()
    feet = world.trees.position_m[boxes.tree, :2]
    assert np.allclose(boxes.range_m, np.linalg.norm(feet - renderer.eye_m[:2], axis=1))
    assert (np.diff(boxes.range_m) >= 0.0).all()


def test_looking_at_one_tree_leaves_the_picture_as_it_was(world, renderer):
    before = renderer.depth_m.copy()
    tree_boxes(renderer, world.trees, within_m=10.0)
    assert np.array_equal(renderer.depth_m, before)


def test_a_tree_counts_when_enough_of_it_is_seen(world, renderer):
    boxes = tree_boxes(renderer, world.trees)
    rule = Annotation(within_m=15.0, visible_px=400, visible_share=0.5)
    by_hand = [
        boxes.range_m[k] <= 15.0 and boxes.visible_px[k] >= 400 and boxes.visible_share[k] >= 0.5
        for k in range(len(boxes))
    ]
    assert rule.counts(boxes).tolist() == by_hand
    assert 0 < sum(by_hand) < len(boxes)
    assert boxes[rule.counts(boxes)].tree.tolist() == boxes.tree[by_hand].tolist()
