"""The forest is the one asked for: same from the same seed, trees apart, diameters true, the path free."""

import numpy as np
import pytest

from drivers.errors import SimulationError
from drivers.sim import forest, paths
from drivers.sim.crowns import SUNK_M
from drivers.sim.forest_config import PRESETS, preset
from drivers.sim.planting import SUCKER_SPACING_M, apart
from drivers.sim.scene import Kind, Made, Scene
from drivers.sim.species import Species


def _scene(name: str = "mixed", seed: int = 5, length_m: float = 80.0, shape: str = "loop") -> Scene:
    return forest.grow(preset(name, seed), paths.route(shape, length_m, seed))


def _distances(a, b):
    return np.linalg.norm(a[:, None, :] - b[None, :, :], axis=2)


@pytest.mark.parametrize("shape", ["loop", "out_and_back"])
@pytest.mark.parametrize("length_m", [48.0, 300.0, 1200.0])
def test_routes_have_the_length_asked_for_and_come_back(shape, length_m):
    route = paths.route(shape, length_m, 4)
    assert route.length_m == pytest.approx(length_m, rel=0.03)
    np.testing.assert_allclose(route.points_m[0], 0.0, atol=1e-9)
    assert np.linalg.norm(route.points_m[-1]) < 1.0
    steps = np.linalg.norm(np.diff(route.points_m, axis=0), axis=1)
    assert steps.max() < 1.05 * paths.STEP_M
    turn = np.abs(np.diff(np.unwrap(np.arctan2(*np.diff(route.points_m, axis=0).T[::-1]))))
    assert turn.max() < paths.STEP_M / 1.0, "no turn is tighter than a radius of one metre"


def test_unknown_names_are_refused():
    with pytest.raises(SimulationError, match="mixed"):
        preset("jungle", 1)
    with pytest.raises(SimulationError, match="loop"):
        paths.route("spiral", 50.0, 1)


def test_same_seed_same_forest():
    one, two, other = _scene(), _scene(), _scene(seed=6)
    for name in ("centre_m", "semi_axes_m", "frond"):
        np.testing.assert_array_equal(getattr(one.foliage, name), getattr(two.foliage, name))
    np.testing.assert_array_equal(one.stems.base_m, two.stems.base_m)
    assert one.stems.base_m.shape != other.stems.base_m.shape or not np.array_equal(
        one.stems.base_m, other.stems.base_m
    )


@pytest.mark.parametrize("name", list(PRESETS))
def test_every_preset_leaves_the_path_free_and_keeps_trees_apart(name):
    scene = _scene(name)
    xy = scene.trees.position_m[:, :2]
    to_path = _distances(xy, scene.trail.line_m).min(axis=1)
    assert (to_path - 0.5 * scene.trees.dbh_m).min() > 0.8
    between = _distances(xy, xy)
    np.fill_diagonal(between, np.inf)
    assert between.min() >= SUCKER_SPACING_M - 1e-9
    radii = 0.5 * scene.trees.dbh_m
    assert (between - radii[:, None] - radii[None, :]).min() > 0.0
    assert (scene.trees.species == Species.TREE_OF_HEAVEN).sum() >= 3
    assert np.all(np.isfinite(scene.foliage.centre_m))


def test_density_and_diameters_are_those_of_the_preset():
    config = preset("mixed", 5)
    scene = _scene("mixed", length_m=300.0)
    wild = scene.trees.clone < 0
    terrain = scene.terrain
    reach = forest.distance_to(paths.route("loop", 300.0, 5), terrain, 60.0)
    wooded_ha = float((reach < config.corridor_m).sum()) * terrain.cell_m**2 / 1e4
    assert wild.sum() / wooded_ha == pytest.approx(config.stems_per_ha, rel=0.15)
    broad = wild & (scene.trees.species != Species.SUMAC)
    expected = np.random.default_rng(0).weibull(config.dbh_shape, 100_000) * config.dbh_scale_m + 0.03
    for share in (0.1, 0.5, 0.9):
        assert np.quantile(scene.trees.dbh_m[broad], share) == pytest.approx(np.quantile(expected, share), rel=0.12)


def test_stem_is_as_thick_at_breast_height_as_the_inventory_says():
    scene = _scene()
    stems, trees = scene.stems, scene.trees
    share = (1.3 + SUNK_M) / (stems.top_m[:, 2] - stems.base_m[:, 2])
    radius = stems.radius_base_m + share * (stems.radius_top_m - stems.radius_base_m)
    np.testing.assert_allclose(2.0 * radius, trees.dbh_m, atol=2e-4)
    ground = scene.terrain.height_at(trees.position_m[:, :2])
    np.testing.assert_allclose(stems.base_m[:, 2], ground - SUNK_M, atol=1e-3)


def test_tape_is_on_the_taped_stems_only():
    scene = _scene("mixed", length_m=300.0)
    assert 0 < scene.trees.taped.sum() < 0.1 * len(scene.trees)
    np.testing.assert_array_equal(np.isfinite(scene.stems.tape_m[:, 0]), scene.trees.taped)


def test_tree_of_heaven_carries_long_fronds_and_oaks_none():
    foliage = _scene().foliage
    crown = foliage.kind == Kind.CROWN
    assert foliage.frond_m[crown & (foliage.species == Species.TREE_OF_HEAVEN)].min() > 0.6
    assert foliage.frond_m[crown & (foliage.species == Species.SUMAC)].max() < 0.5
    assert foliage.frond_m[foliage.species == Species.OAK].max() == 0.0
    lengths = np.linalg.norm(foliage.frond[crown], axis=1)
    np.testing.assert_allclose(lengths, 1.0, atol=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_no_tree_grows_through_a_bench_or_a_fence(seed):
    scene = _scene("mixed", seed=seed, length_m=250.0)
    boxes, stems = scene.boxes, scene.trees
    assert {Made.BENCH, Made.FENCE_POST, Made.FENCE_RAIL, Made.SIGN} <= set(boxes.made.tolist())
    for centre, half, yaw in zip(boxes.centre_m, boxes.half_m, boxes.yaw_rad, strict=True):
        offset = stems.position_m[:, :2] - centre[:2]
        ahead = np.abs(offset @ (np.cos(yaw), np.sin(yaw))) - half[0]
        aside = np.abs(offset @ (-np.sin(yaw), np.cos(yaw))) - half[1]
        outside = np.hypot(np.maximum(ahead, 0.0), np.maximum(aside, 0.0))
        assert (outside > 0.5 * stems.dbh_m).all()
        assert _distances(centre[None, :2], scene.trail.line_m).min() > 0.9


def test_grass_and_shrubs_keep_off_the_trail():
    scene = _scene()
    low = scene.foliage.kind != Kind.CROWN
    away = _distances(scene.foliage.centre_m[low, :2].astype(float), scene.trail.line_m).min(axis=1)
    assert (away < 0.5 * scene.trail.width_m - 0.5).sum() == 0


def test_darts_are_kept_in_order_and_apart():
    darts = np.array([[0.0, 0.0], [0.5, 0.0], [3.0, 0.0], [9.0, 9.0]])
    np.testing.assert_array_equal(apart(darts, np.array([[9.2, 9.0]]), 1.0), [0, 2])
