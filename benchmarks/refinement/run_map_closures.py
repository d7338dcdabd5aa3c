"""`map_closures` over submaps, in an environment of its own. Needs numpy and it, nothing of this project.

    python run_map_closures.py INPUT.npz OUTPUT.npz

INPUT: xyz (n, 3) float32, ends (submaps,). OUTPUT, of every closure with as many inliers as it asks for by itself: onto
(k, 2) earlier submap and later one, inliers (k,), poses (k, 4, 4) from the points of the later one to those of the
earlier one; and seconds of processor time. It is told which points are ground: in made-up stands it takes trunks
for it by itself, and lays submaps on their sides.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from map_closures.config import MapClosuresConfig
from map_closures.map_closures import MapClosures

GROUND_M = 2.0
"""The lowest point of each cell of this size is ground."""


def main() -> None:
    data = np.load(sys.argv[1])
    config = MapClosuresConfig()
    detector, found = MapClosures(config), []
    begun = time.process_time()
    for number, cloud in enumerate(np.split(data["xyz"].astype(np.float64), data["ends"][:-1])):
        ground = lowest(cloud)
        found += detector.get_closures(number, cloud, ground, np.tile([0.0, 0.0, 1.0], (len(ground), 1)))
    seconds = time.process_time() - begun
    found = [one for one in found if one.number_of_inliers >= config.inliers_threshold]
    np.savez(
        sys.argv[2],
        onto=np.array([(one.source_id, one.target_id) for one in found], np.int64).reshape(-1, 2),
        inliers=np.array([one.number_of_inliers for one in found], np.int64),
        poses=np.array([np.linalg.inv(one.pose) for one in found]).reshape(-1, 4, 4),
        seconds=seconds,
    )


def lowest(cloud):
    """(cells, 3)."""
    cells = np.floor(cloud[:, :2] / GROUND_M).astype(np.int64)
    order = np.lexsort((cloud[:, 2], cells[:, 1], cells[:, 0]))
    first = np.any(np.diff(cells[order], axis=0, prepend=cells[order[:1]] - 1), axis=1)
    return cloud[order[first]]


if __name__ == "__main__":
    main()
