import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.odometry.cluster_kernels import cluster


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
