import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.odometry import map_kernels as kernels
from pipeline.odometry import so3
from pipeline.odometry.cluster_kernels import cluster
from pipeline.odometry.config import MapConfig, MatchConfig
from pipeline.odometry.match_kernels import match
from pipeline.odometry.voxel_map import VoxelMap

CONFIG = MatchConfig()
SCANS = 10
SETTINGS = np.array(
    [
        CONFIG.fewest_points,
        CONFIG.floor_m,
        CONFIG.huber,
        CONFIG.gate,
        CONFIG.wide,
        CONFIG.prior,
        CONFIG.prior_points,
        CONFIG.directions,
        SCANS - 2,
        CONFIG.fresh_share,
        CONFIG.round_m,
    ]
)
UNBOUNDED = np.array([*SETTINGS[:2], np.inf, np.inf, *SETTINGS[4:]])


def grove(seed, count=6000):
    """Points of a floor, a wall and stems about the origin."""
    random = np.random.default_rng(seed)
    floor = np.column_stack([random.uniform(-8, 8, (count, 2)), np.full(count, -1.3)])
    wall = np.column_stack([np.full(count, 6.0), random.uniform(-8, 8, count), random.uniform(-1, 4, count)])
    stems = random.uniform(-7, 7, (40, 2))[random.integers(0, 40, 2 * count)]
    angle, height = random.uniform(0, 2 * math.pi, 2 * count), random.uniform(-1, 4, 2 * count)
    stem = np.column_stack([stems + 0.04 * np.column_stack([np.cos(angle), np.sin(angle)]), height])
    return np.concatenate([floor, wall, stem]) + random.normal(0, 0.01, (4 * count, 3))


def clusters_of(points, rotation, position):
    seen = (points - position) @ rotation
    slots, owners = np.empty(1 << 17, np.int64), np.empty(1 << 17, np.int32)
    return cluster(seen, np.full(len(points), 20, np.uint8), rotation, position, CONFIG.leaf_m, slots, owners)


@pytest.fixture(scope="module")
def scene():
    """A map of some scans, another scan's clusters, and a pose a little off."""
    grown = VoxelMap(MapConfig(voxels_most=50_000))
    for seed in range(SCANS):
        grown.insert(clusters_of(grove(seed), np.eye(3), np.zeros(3)), np.eye(3), np.zeros(3))
    rotation, position = Rotation.from_euler("xyz", [0.004, -0.003, 0.006]).as_matrix(), np.array([0.03, -0.02, 0.01])
    clusters = clusters_of(grove(9)[::5], np.eye(3), np.zeros(3))
    return grown, clusters, rotation, position


def voxels(grown):
    """key -> (low corner, row), by hand."""
    table = {}
    for key, row in grown.arrays.slots[grown.arrays.slots[:, 0] != kernels.EMPTY].tolist():
        table[key] = grown.arrays.voxels[row].astype(float)
    return table


def residuals(grown, clusters, rotation, position, settings=SETTINGS):
    """Slow and obvious: for each cluster that meets a voxel, (q, r, [(direction, weight)], distance)."""
    fewest, floor, huber, gate, wide, prior, extra, most, settled, fresh, off = settings
    table = voxels(grown)
    for row in clusters:
        q = row[1:4]
        world = rotation @ q + position
        side = kernels.side(*(world - position)[:2])
        for level, size in enumerate(grown.sizes):
            cell = np.floor(world / size).astype(int)
            voxel = table.get(kernels.pack(*cell.tolist(), side + kernels.SIDES * level))
            if voxel is None or voxel[kernels.COUNT] < fewest:
                continue
            count = voxel[kernels.COUNT]
            scatter = np.zeros((3, 3))
            scatter[np.triu_indices(3)] = voxel[kernels.SCATTER : kernels.SCATTER + 6]
            scatter = (scatter + scatter.T - np.diag(np.diag(scatter))) / count
            values, vectors = np.linalg.eigh(scatter)
            values = (count * values + extra * prior * size**2) / (count + extra)
            r = world - cell * size - voxel[kernels.MEAN : kernels.MEAN + 3]
            view = (position - world)[:2] / np.linalg.norm((position - world)[:2])
            before = voxel[kernels.VIEW : kernels.VIEW + 2]
            r[:2] += off * (1.0 - view @ before / (before @ before)) * before
            share, used = 1.0 / row[0] + 1.0 / count, (values < wide * size**2) & (np.arange(3) < most)
            variance = values * share + floor**2
            distance = float(np.sum(((r @ vectors) ** 2 / variance)[used]))
            if distance <= gate**2:
                robust = 1.0 if distance <= huber**2 else huber / math.sqrt(distance)
                age = np.clip((SCANS - voxel[kernels.SEEN]) / settled, fresh, 1.0)
                weights = age * robust * (1.0 - values / (wide * size**2)) / variance
                yield q, r, [(vectors[:, k], weights[k]) for k in range(3) if used[k]], distance, robust, age
            break


def test_the_normal_equations_are_the_sums_over_clusters_and_voxels(scene):
    grown, clusters, rotation, position = scene
    a, b, numbers = match(grown.arrays, clusters, rotation, position, grown.sizes, 4, 0, SETTINGS)
    expected_a, expected_b, sums = np.zeros((6, 6)), np.zeros(6), np.zeros(5)
    for q, r, directions, distance, robust, age in residuals(grown, clusters, rotation, position):
        sums += [1, distance, robust, len(directions), age]
        for u, weight in directions:
            h = np.concatenate([np.cross(q, rotation.T @ u), u])
            expected_a += weight * np.outer(h, h)
            expected_b += weight * (u @ r) * h
    assert sums[0] > 500
    assert sums[2] < sums[0]  # some are beyond Huber's bound
    assert numbers[0] == sums[0]
    np.testing.assert_allclose(numbers, sums, rtol=2e-3)
    scale = np.sqrt(np.outer(np.diag(expected_a), np.diag(expected_a)))
    np.testing.assert_allclose(a / scale, expected_a / scale, atol=2e-3)
    np.testing.assert_allclose(b / np.sqrt(np.diag(expected_a)), expected_b / np.sqrt(np.diag(expected_a)), atol=0.3)


def test_the_gradient_is_the_derivative_of_the_cost(scene):
    """Oracle: finite differences of half the weighted squares, pairs held as they are."""
    grown, clusters, rotation, position = scene
    a, b, _ = match(grown.arrays, clusters, rotation, position, grown.sizes, 4, 0, UNBOUNDED)
    pairs = list(residuals(grown, clusters, rotation, position, UNBOUNDED))

    def cost(error):
        turn, shift = rotation @ so3.exp(error[:3]), error[3:] + position
        moved = (turn @ q + shift - (rotation @ q + position - r) for q, r, *_ in pairs)
        return sum(0.5 * w * (u @ m) ** 2 for m, pair in zip(moved, pairs, strict=True) for u, w in pair[2])

    step, steps = 1e-4, np.eye(6)
    gradient = np.array([(cost(step * e) - cost(-step * e)) / (2 * step) for e in steps])
    curvature = np.array([(cost(step * e) - 2 * cost(np.zeros(6)) + cost(-step * e)) / step**2 for e in steps])
    scale = np.sqrt(np.diag(a))
    np.testing.assert_allclose(b / scale, gradient / scale, atol=0.3)
    np.testing.assert_allclose(np.diag(a), curvature, rtol=0.05)  # Gauss-Newton leaves the second derivative out


def test_steps_of_the_update_end_where_the_scan_was_seen_from(scene):
    grown, clusters, rotation, position = scene
    for _ in range(8):
        a, b, _ = match(grown.arrays, clusters, rotation, position, grown.sizes, 4, 0, SETTINGS)
        step = -np.linalg.solve(a, b)
        rotation, position = rotation @ so3.exp(step[:3]), position + step[3:]
    np.testing.assert_allclose(position, np.zeros(3), atol=3e-3)
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-3)


def test_levels_before_the_first_are_left_out(scene):
    grown, clusters, rotation, position = scene
    fine = match(grown.arrays, clusters, rotation, position, grown.sizes, 4, 0, SETTINGS)[2]
    coarse = match(grown.arrays, clusters, rotation, position, grown.sizes, 4, 1, SETTINGS)[2]
    assert coarse[0] > 0.5 * fine[0]
    assert coarse[3] < fine[3]  # a wide voxel shows fewer directions


def test_nothing_in_view_says_nothing(scene):
    grown, clusters, rotation, _ = scene
    a, b, numbers = match(grown.arrays, clusters, rotation, np.array([500.0, 0.0, 0.0]), grown.sizes, 4, 0, SETTINGS)
    assert not a.any()
    assert not b.any()
    assert not numbers.any()


def half_stems(seed, position, count=8000):
    """Points of the sides that stems of 8 cm show to a sensor at a position, and of a floor, in its frame."""
    random = np.random.default_rng(seed)
    middles = np.random.default_rng(5).uniform(5.0, 10.0, (30, 2))[random.integers(0, 30, count)]
    towards = np.arctan2(*(position[:2] - middles).T[::-1]) + random.uniform(-1.4, 1.4, count)
    stems = middles + 0.08 * np.column_stack([np.cos(towards), np.sin(towards)])
    floor = np.column_stack([random.uniform(5.0, 10.0, (count, 2)), np.full(count, -1.3)])
    both = np.concatenate([np.column_stack([stems, random.uniform(-1.2, 3.0, count)]), floor])
    return both + random.normal(0, 0.01, both.shape)


def test_stems_seen_from_elsewhere_do_not_push_away():
    grown, there = VoxelMap(MapConfig(voxels_most=50_000)), np.array([4.5, -3.0, 0.0])
    for seed in range(SCANS):
        grown.insert(clusters_of(half_stems(seed, np.zeros(3)), np.eye(3), np.zeros(3)), np.eye(3), np.zeros(3))
    clusters = clusters_of(half_stems(9, there), np.eye(3), there)
    pushed = []
    for off in (0.0, CONFIG.round_m):
        rotation, position, settings = np.eye(3), there, np.array([*SETTINGS[:-1], off])
        for _ in range(8):
            a, b, _ = match(grown.arrays, clusters, rotation, position, grown.sizes, 4, 0, settings)
            step = -np.linalg.solve(a, b)
            rotation, position = rotation @ so3.exp(step[:3]), position + step[3:]
        pushed.append(float(np.linalg.norm(position - there)))
    assert pushed[1] < 0.6 * pushed[0]
