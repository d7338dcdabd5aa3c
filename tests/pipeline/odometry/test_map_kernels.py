import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.odometry import map_kernels as kernels
from pipeline.odometry.cluster_kernels import CLUSTER

SIZES = np.array([0.5, 2.0])
TRIANGLE = np.triu_indices(3)


def empty(rows=64, places=256):
    return kernels.MapArrays(
        slots=np.full((places, 2), kernels.EMPTY, np.int64),
        voxels=np.zeros((rows, kernels.VOXEL), np.float32),
        free=np.arange(rows, dtype=np.int32)[::-1].copy(),
        numbers=np.array([0, 0, 0, rows], np.int64),
    )


def gathered(points, intensity):
    """One cluster of points (n, 3)."""
    row = np.zeros(CLUSTER)
    row[0], row[1:4] = len(points), points.mean(axis=0)
    row[4:10] = ((points - row[1:4]).T @ (points - row[1:4]))[TRIANGLE]
    row[10], row[11] = intensity.mean(), intensity.max()
    return row


def found(grid, key):
    slot = kernels.place(grid.slots, key)
    return grid.voxels[grid.slots[slot, 1]] if grid.slots[slot, 0] == key else None


def keys(grid):
    return set(grid.slots[grid.slots[:, 0] != kernels.EMPTY, 0].tolist())


def test_a_voxel_holds_the_statistics_of_all_points_in_it():
    """Oracle: numpy over the points themselves. One grid cell, seen from one side, scan by scan."""
    random, grid = np.random.default_rng(4), empty()
    rotation, position = Rotation.from_euler("xyz", [0.3, -0.2, 2.0]).as_matrix(), np.array([-8.0, -6.0, 1.0])
    points, intensity, groups = [], [], []
    for _ in range(7):
        group = random.uniform([10.05, 4.05, 2.05], [10.45, 4.45, 2.45], (random.integers(1, 6), 3))
        bright = random.integers(0, 200, len(group)).astype(float)
        points.append(group)
        intensity.append(bright)
        groups.append(gathered((group - position) @ rotation, bright))
    for scan, row in enumerate(groups):
        kernels.insert(grid, row[None], rotation, position, SIZES, 4, 10**9, scan)
    points, intensity = np.concatenate(points), np.concatenate(intensity)
    side = kernels.side(1.0, 1.0)
    for level, size in enumerate(SIZES):
        cell = np.floor(points[0] / size).astype(int)
        voxel = found(grid, kernels.pack(*cell.tolist(), side + kernels.SIDES * level))
        centred = points - points.mean(axis=0)
        assert voxel[kernels.COUNT] == len(points)
        np.testing.assert_allclose(
            voxel[kernels.MEAN : kernels.MEAN + 3], (points - cell * size).mean(axis=0), atol=1e-5
        )
        scatter = voxel[kernels.SCATTER : kernels.SCATTER + 6]
        np.testing.assert_allclose(scatter, (centred.T @ centred)[TRIANGLE], atol=1e-5)
        assert voxel[kernels.INTENSITY] == pytest.approx(intensity.mean(), rel=1e-5)
        assert voxel[kernels.BRIGHTEST] == intensity.max()


def test_a_full_voxel_keeps_its_shape():
    grid, row = empty(), gathered(np.full((10, 3), 0.25), np.full(10, 7.0))
    for scan in range(3):
        kernels.insert(grid, row[None], np.eye(3), np.zeros(3), SIZES, 4, 20, scan)
    voxel = found(grid, kernels.pack(0, 0, 0, kernels.side(1.0, 1.0)))
    assert voxel[kernels.COUNT] == 20.0


def test_each_side_of_a_thing_has_a_voxel_of_its_own():
    grid = empty()
    for eye in ([-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [9.0, 9.0, 0.0], [-9.0, 9.0, 0.0]):
        row = gathered(np.array([[0.1, 0.1, 0.1]]) - eye, np.array([1.0]))
        kernels.insert(grid, row[None], np.eye(3), np.array(eye), SIZES[:1], 4, 100, 1)
    assert len(keys(grid)) == 4
    one = empty()
    for eye in ([-9.0, -9.0, 0.0], [9.0, 9.0, 0.0]):
        row = gathered(np.array([[0.1, 0.1, 0.1]]) - eye, np.array([1.0]))
        kernels.insert(one, row[None], np.eye(3), np.array(eye), SIZES[:1], 1, 100.0, 1)
    assert len(keys(one)) == 1


@given(st.integers(0, 2**32 - 1), st.floats(1.0, 90.0), st.floats(0.0, 20.0))
def test_the_shape_of_a_voxel_is_its_eigenvalues_shrunk_to_the_prior(seed, count, extra):
    random, prior = np.random.default_rng(seed), 0.0025
    axes = Rotation.random(random_state=random).as_matrix()
    spread = random.uniform(0.0, 0.1, 3) * random.integers(0, 2, 3)  # flat and thin ones too
    scatter = count * axes @ np.diag(spread**2) @ axes.T
    voxel = np.zeros(kernels.VOXEL, np.float32)
    voxel[kernels.COUNT], voxel[kernels.SCATTER : kernels.SCATTER + 6] = count, scatter[TRIANGLE]
    kernels.derive(voxel, prior, extra)
    values, _ = np.linalg.eigh(scatter / count)
    weight = count / (count + extra)
    got = voxel[kernels.VARIANCES : kernels.VARIANCES + 3]
    np.testing.assert_allclose(got, weight * values + (1.0 - weight) * prior, atol=2e-8)
    vectors = voxel[kernels.DIRECTIONS : kernels.DIRECTIONS + 9].reshape(3, 3).astype(float)
    np.testing.assert_allclose(vectors @ vectors.T, np.eye(3), atol=1e-5)
    back = vectors.T @ np.diag((got - (1.0 - weight) * prior) / weight) @ vectors
    np.testing.assert_allclose(back, scatter / count, atol=1e-7)


cells = st.tuples(st.integers(-6, 6), st.integers(-6, 6), st.integers(-1, 1))
deeds = st.lists(st.tuples(cells, st.integers(1, 6), st.booleans()), max_size=60)


@settings(max_examples=200)
@given(deeds)
def test_the_table_holds_what_a_dictionary_would(done):
    """Oracle: a dictionary. Few rows and few places, so that probes collide, wrap and run out of room."""
    grid, model, refused = empty(rows=12, places=32), {}, 0
    for scan, (cell, points, forget) in enumerate(done):
        row = gathered(np.tile(np.array(cell) * 0.5 + 0.25, (points, 1)), np.zeros(points))
        eye = np.array([-100.0, -100.0, 0.0])  # all is seen from one side
        row[1:4] -= eye
        kernels.insert(grid, row[None], np.eye(3), eye, SIZES[:1], 4, 1e9, scan)
        key = kernels.pack(*cell, kernels.side(1.0, 1.0))
        if key in model or len(model) < 12:
            count, seen = model.get(key, (0, 0.0))
            model[key] = (count + points, (count * seen + points * scan) / (count + points))
        else:
            refused += 1
        if forget:
            centre = np.array(cell) * 0.5
            places = len(grid.slots) + len(model)  # a removal counts as a look too
            kernels.sweep(grid, centre, SIZES[:1], 2.0, scan, 5, places)
            model = {
                key: (count, seen)
                for key, (count, seen) in model.items()
                if np.linalg.norm(corner(key) - centre) <= 2.0 and not (count < kernels.THIN and scan - seen > 5)
            }
        assert keys(grid) == set(model)
        assert grid.numbers[kernels.USED] == len(model)
        assert grid.numbers[kernels.REFUSED] == refused
        assert len(set(grid.free[: grid.numbers[kernels.FREE]].tolist())) == 12 - len(model)
        for one, (count, seen) in model.items():
            voxel = found(grid, one)
            assert (voxel[kernels.COUNT], voxel[kernels.SEEN]) == (count, pytest.approx(seen, rel=1e-5))
            np.testing.assert_allclose(voxel[kernels.VIEW : kernels.VIEW + 2], -np.sqrt([0.5, 0.5]), atol=0.05)


def corner(key):
    """(3,) low corner, m."""
    fields = [(key >> (k * kernels.BITS)) & kernels.FIELD for k in (2, 1, 0)]
    return 0.5 * (np.array(fields) - kernels.HALF)
