import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.odometry import so3
from pipeline.odometry.cluster_kernels import cluster
from pipeline.odometry.config import DegeneracyConfig, MapConfig
from pipeline.odometry.degeneracy import damp, observe
from pipeline.odometry.deskew_kernels import deskew
from pipeline.odometry.errors import StartRefused
from pipeline.odometry.initialise import force_scale
from pipeline.odometry.voxel_map import VoxelMap

turns = st.lists(st.floats(-1.7, 1.7), min_size=3, max_size=3).map(np.array)


@given(turns)
def test_exponential_and_logarithm_are_scipys(v):
    rotation = so3.exp(v)
    np.testing.assert_allclose(rotation, Rotation.from_rotvec(v).as_matrix(), atol=1e-9)
    np.testing.assert_allclose(so3.log(rotation), v, atol=1e-6)


@given(turns)
def test_right_jacobian_is_the_derivative(v):
    small = np.array([1e-6, -2e-6, 1.5e-6])
    moved = Rotation.from_rotvec(v).inv() * Rotation.from_rotvec(v + small)
    np.testing.assert_allclose(so3.right_jacobian(v) @ small, moved.as_rotvec(), atol=1e-10)
    np.testing.assert_allclose(so3.right_jacobian(v) @ so3.right_jacobian_inverse(v), np.eye(3), atol=1e-7)


def test_a_standing_point_lands_in_one_place_whenever_it_was_seen():
    spin, velocity, lever = np.array([0.3, -0.8, 2.0]), np.array([1.5, -0.4, 0.2]), np.array([-0.011, -0.023, 0.044])
    knot_s = np.linspace(0.0, 0.1, 21)
    bodies = Rotation.from_rotvec(knot_s[:, None] * spin)
    knots = np.zeros((21, 22))
    knots[:, 0], knots[:, 1:10] = knot_s, bodies.as_matrix().reshape(-1, 9)
    knots[:, 10:13], knots[:, 13:16], knots[:, 19:22] = knot_s[:, None] * velocity, velocity, spin
    seen_s = np.array([0.0, 0.0123, 0.05, 0.0999, 0.031])  # unsorted
    point = np.array([4.0, -2.0, 1.0])
    then = Rotation.from_rotvec(seen_s[:, None] * spin)
    xyz = then.inv().apply(point - seen_s[:, None] * velocity) - lever
    moved = deskew(xyz.astype(np.float32), seen_s, knots, np.eye(3), lever)
    expected = bodies[-1].inv().apply(point - 0.1 * velocity)
    np.testing.assert_allclose(moved, np.tile(expected, (5, 1)), atol=2e-6)


def test_clusters_are_the_statistics_of_their_cells():
    random = np.random.default_rng(3)
    points, intensity = random.uniform(-2, 2, (3000, 3)), random.integers(0, 255, 3000).astype(np.uint8)
    rotation, position = Rotation.from_euler("xyz", [0.1, -0.2, 0.7]).as_matrix(), np.array([5.0, -3.0, 1.0])
    slots, owners = np.empty(1 << 13, np.int64), np.empty(1 << 13, np.int32)
    found = cluster(points, intensity, rotation, position, 0.5, slots, owners)
    cells = np.floor((points @ rotation.T + position) / 0.5).astype(int)
    groups = [np.flatnonzero((cells == cell).all(axis=1)) for cell in np.unique(cells, axis=0)]
    assert len(found) == len(groups)
    by_mean = {tuple(np.round(row[1:4], 6)): row for row in found}
    for group in groups:
        part = points[group]
        row = by_mean[tuple(np.round(part.mean(axis=0), 6))]
        scatter = (part - part.mean(axis=0)).T @ (part - part.mean(axis=0))
        assert row[0] == len(group)
        np.testing.assert_allclose(row[4:10], scatter[np.triu_indices(3)], atol=1e-9)
        assert row[10] == pytest.approx(intensity[group].mean())
        assert row[11] == intensity[group].max()


def test_the_map_of_a_long_ride_takes_no_more_memory():
    random = np.random.default_rng(5)
    grown = VoxelMap(MapConfig(voxels_most=4000))
    before = grown.nbytes
    for k in range(1500):
        clusters = np.zeros((150, 12))
        clusters[:, 0], clusters[:, 1:4] = 8.0, random.uniform(-20, 20, (150, 3))
        grown.insert(clusters, np.eye(3), np.array([4.0 * k, 0.0, 0.0]))  # 6 km
        assert len(grown) <= 4000
    assert grown.nbytes == before
    assert len(grown) > 1000


def test_over_a_meadow_the_way_and_the_heading_are_weak():
    information, normal = np.zeros((6, 6)), np.array([0.0, 0.0, 1.0])
    for point in np.random.default_rng(1).uniform([-20, -20, -1], [20, 20, -1], (500, 3)):
        row = np.concatenate([np.cross(point, normal), normal])
        information += np.outer(row, row) / 0.02**2
    seen = observe(information, DegeneracyConfig())
    assert seen.degenerate
    np.testing.assert_allclose(np.abs(seen.weak_attitude), [[0, 0, 1]], atol=1e-6)
    assert len(seen.weak_position) == 2
    assert np.abs(seen.weak_position[:, 2]).max() < 0.1
    kept, _ = damp(information, np.zeros(6), seen, share=0.01)
    assert kept[5, 5] == pytest.approx(information[5, 5], rel=0.02)  # the height is as sure as it was


def test_a_room_is_not_degenerate():
    assert not observe(np.diag([1e6] * 3 + [1e5] * 3).astype(float), DegeneracyConfig()).degenerate


def readings(force):
    return np.column_stack([np.arange(50.0), np.zeros((50, 3)), np.tile(force, (50, 1))])


def test_the_unit_of_the_accelerometer_is_found_or_refused():
    assert force_scale(readings([0.1, -0.2, 9.8])) == 1.0
    assert force_scale(readings([0.01, -0.02, 0.999])) == pytest.approx(9.80665)
    with pytest.raises(StartRefused, match="unit"):
        force_scale(readings([0.0, 0.0, 32.2]))  # feet
