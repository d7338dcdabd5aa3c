import numpy as np

from pipeline.odometry.config import MapConfig
from pipeline.odometry.voxel_map import VoxelMap


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
