import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.optimize import least_squares

from pipeline.inventory import bark_kernels, circle_kernels, inventory
from pipeline.inventory.bark import fit_bark
from pipeline.inventory.blocks import BlockStore
from pipeline.inventory.candidates import Layered
from pipeline.inventory.config import InventoryConfig, Scanner
from pipeline.inventory.inventory import take_inventory
from pipeline.inventory.stems import find_stems
from pipeline.inventory.terrain import TerrainBuilder
from tests.pipeline.inventory.plots import RIM, PlotMap, Trunk, block, slope

TRUNKS = [
    Trunk(-6, 5, 0.31, (0.03, -0.02)),
    Trunk(0, 8, 0.22),
    Trunk(5, 4, 0.14, (-0.05, 0.0)),
    Trunk(9, -7, 0.40),
    Trunk(-3, -9, 0.11),
]
CONFIG = InventoryConfig()


def test_stems_on_a_slope_under_brush_have_the_diameters_that_they_have():
    found = take_inventory(PlotMap(TRUNKS), CONFIG)
    assert len(found.stems) == len(TRUNKS)
    for trunk in TRUNKS:
        stem = min(found.stems, key=lambda s: np.hypot(*(s.base_m[:2] - (trunk.x + 20, trunk.y + 20))))
        np.testing.assert_allclose(stem.base_m[:2], (trunk.x + 20, trunk.y + 20), atol=0.06)
        assert abs(stem.base_m[2] - 20 - slope(np.array([[trunk.x, trunk.y]]))[0]) < 0.08
        assert abs(stem.dbh_m - trunk.dbh) < max(0.05 * trunk.dbh, 0.008)
        assert abs(stem.dbh_m - trunk.dbh) < 3.0 * stem.dbh_sigma_m
        np.testing.assert_allclose(stem.lean, trunk.lean, atol=0.015)
    np.testing.assert_allclose(found.height_m, 12.0, atol=1.5)


def test_what_the_beam_adds_to_a_sapling_is_taken_off():
    far = Trunk(0, 14, 0.12)
    points = Layered.of(block([far], noise=(0.0018, 0.0136)))
    (stem,) = [s for s in find_stems(points, 0.0, CONFIG) if not s.reason]
    assert stem.fitted_dbh_m > 1.1 * far.dbh
    assert abs(stem.dbh_m - far.dbh) < 0.07 * far.dbh


def test_what_is_lost_at_the_edges_of_far_stems_is_made_up_for():
    sensors, trunk = np.array([[x, 0.0] for x in np.arange(-6.0, 6.1, 2.0)]), Trunk(0, 12, 0.2, taper=0.0)
    error = {0.0: [], RIM[2]: []}
    for seed in range(8):
        xyh, stood = trunk.points(np.random.default_rng(seed), 800, sensors, (0.002, 0.016))
        beam = (trunk.x, trunk.y) - stood
        away = np.linalg.norm(beam, axis=1)
        xyh -= (trunk.x, trunk.y, 1.3)
        for loss, errors in error.items():
            scanner = Scanner(rim_loss=loss)
            errors.append(
                fit_bark(xyh, beam / away[:, None], away, radius_m=0.12, taper=0.0, scanner=scanner).radius_m - 0.1
            )
    assert abs(np.mean(error[RIM[2]])) < 0.002
    assert np.mean(error[0.0]) < -0.004


def test_a_wide_circle_that_a_fit_begins_with_does_not_stay():
    sensors, trunk = np.array([[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]), Trunk(0, 15, 0.12, taper=0.0)
    xyh, stood = trunk.points(np.random.default_rng(1), 500, sensors, (0.0018, 0.0136))
    beam = (trunk.x, trunk.y) - stood
    away = np.linalg.norm(beam, axis=1)
    for radius, shift in ((0.06, (0.0, 0.0)), (0.13, (0.0, 0.1)), (0.16, (0.0, 0.0)), (0.16, (0.05, 0.0))):
        seen = xyh - (trunk.x + shift[0], trunk.y + shift[1], 1.3)
        found = fit_bark(seen, beam / away[:, None], away, radius_m=radius, taper=0.0, scanner=CONFIG.scanner)
        assert found.radius_m == pytest.approx(0.06, abs=0.002)


def test_a_small_tree_is_a_stem_up_to_its_own_crown():
    random = np.random.default_rng(4)
    small = Trunk(0, 6, 0.12)
    points = block([small], count=1500)
    points = points[points["height"] < 2.6]
    leaves = np.resize(points, 6000).copy()
    leaves["xyz"] = random.normal([0, 6, 4.3], [0.5, 0.5, 0.8], (len(leaves), 3))
    leaves["height"] = leaves["xyz"][:, 2]
    stems = find_stems(Layered.of(np.concatenate([points, leaves[leaves["height"] > 2.6]])), 0.0, CONFIG)
    (stem,) = [one for one in stems if not one.reason]
    assert abs(stem.dbh_m - small.dbh) < 0.08 * small.dbh
    np.testing.assert_allclose(stem.axis_at(1.3), (small.x, small.y), atol=0.02)


def test_without_the_place_of_the_scanner_there_are_diameters_too():
    found = take_inventory(PlotMap(TRUNKS, told=False, noise=(0.0005, 0.006)), CONFIG)
    assert len(found.stems) == len(TRUNKS)
    said = sorted(stem.dbh_m for stem in found.stems)
    np.testing.assert_allclose(said, sorted(trunk.dbh for trunk in TRUNKS), rtol=0.12)


def test_where_points_are_dense_blocks_are_smaller_and_the_stems_the_same(monkeypatch):
    source = PlotMap(TRUNKS, each=1000)
    whole = take_inventory(source, CONFIG)
    monkeypatch.setattr(inventory, "MOST_POINTS", 10_000)
    sides = []
    monkeypatch.setattr(inventory, "BlockStore", lambda *given: (sides.append(given[1]), BlockStore(*given))[1])
    cut = take_inventory(source, CONFIG)
    assert sides[0] < CONFIG.block_m / 2
    assert len(cut.stems) == len(TRUNKS)
    np.testing.assert_allclose([s.dbh_m for s in cut.stems], [s.dbh_m for s in whole.stems], atol=0.003)


def test_nothing_found_says_why():
    bare = take_inventory(PlotMap([]), CONFIG)
    assert bare.stems == []
    assert bare.why
    assert bare.height_m.shape == (0,)


def test_a_clump_of_leaves_is_rejected_with_a_reason():
    random = np.random.default_rng(3)
    leaves = block([Trunk(0, 6, 0.3)])
    leaves["xyz"] = random.normal([0, 6, 3], [0.35, 0.35, 1.3], (len(leaves), 3))
    leaves["height"] = leaves["xyz"][:, 2]
    stems = find_stems(Layered.of(leaves), 0.0, CONFIG)
    assert all(stem.reason for stem in stems)


def test_the_ground_is_below_brush_and_steady_on_a_slope():
    source = PlotMap(TRUNKS)
    builder = TerrainBuilder(source, CONFIG)
    for part in source.parts():
        builder.add(part)
    asked = np.random.default_rng(2).uniform(-12, 12, (300, 2))
    error = builder.first().at(asked + 20.0) - 20.0 - slope(asked)
    assert abs(np.median(error)) < 0.06
    assert np.percentile(np.abs(error), 95) < 0.15


def test_the_circle_kernel_agrees_with_a_general_least_squares():
    random = np.random.default_rng(5)
    turn = random.uniform(0, np.pi, 200)
    xy = np.column_stack([np.cos(turn), np.sin(turn)]) * 0.15 + random.normal(0, 0.004, (200, 2)) + (3.0, 4.0)
    x, y, r, _ = circle_kernels.best_circle(xy, 0.02, 0.6, 0.02, 200, 1)
    x, y, r, _ = circle_kernels.refine_circle(xy, x, y, r, 0.02)
    oracle = least_squares(lambda p: np.hypot(*(xy - p[:2]).T) - p[2], [3, 4, 0.1]).x
    np.testing.assert_allclose([x, y, r], oracle, atol=1.5e-3)


def test_the_likelihood_is_the_integral_that_it_says_and_its_gradient_the_derivative():
    random = np.random.default_rng(6)
    count = 40
    turn = random.uniform(0, 2 * np.pi, count)
    seen = np.column_stack(
        [random.normal(0, 0.1, (count, 2)), np.cos(turn), np.sin(turn), random.uniform(-1, 2, count)]
    )
    beams = np.tile([0.015, 0.01, 0.03], (count, 1))
    state = np.array([0.01, -0.02, 0.12, 0.012, -0.05])
    value, gradient, _, _ = bark_kernels.score(seen, beams, 0.4, state, 0.05, 0.2)
    across, along = np.hypot(beams[:, :2].T, state[3])
    y = np.linspace(-1, 1, 4001)
    total = 0.0
    for n in range(count):
        away = seen[n, :2] - state[:2]
        u, v = -seen[n, 3] * away[0] + seen[n, 2] * away[1], seen[n, 2:4] @ away
        r = state[2] * (1 + state[4] * seen[n, 4])
        near = np.exp(-0.5 * ((u - r * y) / across[n]) ** 2 - 0.5 * ((v + r * np.sqrt(1 - y * y)) / along[n]) ** 2)
        kept = 1 - 0.4 * np.exp(-np.pi / 4 * (r * (1 - np.abs(y)) / beams[n, 2]) ** 2)
        p = trapezoid(kept * near, y) / trapezoid(kept, y) / (2 * np.pi * across[n] * along[n])
        total += np.log(0.95 * p + 0.05 / 0.2)
    assert value == pytest.approx(total, rel=0.02)
    for k in range(5):
        step = np.zeros(5)
        step[k] = 1e-5
        ahead, behind = (bark_kernels.score(seen, beams, 0.4, state + s, 0.05, 0.2)[0] for s in (step, -step))
        assert gradient[k] == pytest.approx((ahead - behind) / 2e-5, rel=0.03, abs=2.0)
