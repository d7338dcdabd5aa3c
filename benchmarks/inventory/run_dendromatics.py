"""Runs in an environment with dendromatics (GPL-3), and imports nothing of ours.

    python run_dendromatics.py cloud.npy defaults|"6 cm"|"10 cm"

cloud.npy: (n, 3). The steps are those that its documentation walks through. Prints a line of JSON: x, y and diameter of
each stem, the diameter null where it calls it not reliable; or the error that it ended with.
"""

from __future__ import annotations

import json
import os
import sys

import dendromatics as dm
import numpy as np

STRIPE_M = (0.7, 3.5)
SECTIONS_M = np.arange(0.3, 5.01, 0.2)
AXIS_M = 0.35
"""Points farther from their tree's axis are no stem."""
CIRCLES = {"section_width": 0.2, "n_points_section": 15, "min_n_sectors": 5, "max_dist": 0.15}


def _sparse(voxel_m: float, around_m: float, upright_m: float) -> tuple[dict, dict, dict]:
    """upright_m: height that a cluster must span to be a stem."""
    voxels = {"resolution_xy": voxel_m, "resolution_z": voxel_m}
    clusters = {"scale": around_m, "vert_threshold": 0.5, "n_points": 10, "n_iter": 1, **voxels}
    return clusters, {"min_points": 5, "h_range": upright_m, **voxels}, CIRCLES


SETTINGS = {
    "defaults": ({"n_iter": 2}, {}, {}),
    # The defaults are for a point in a centimetre; of what was tried for fewer, these find the most diameters.
    "6 cm": _sparse(0.06, 0.15, 0.3),
    "10 cm": _sparse(0.10, 0.25, 0.5),
}


def main(path: str, name: str) -> None:
    """Standard output is for the answer alone: its ground filter writes there from C++."""
    answer = os.dup(1)
    os.dup2(2, 1)
    try:
        told = {"stems": stems(np.load(path), *SETTINGS[name])}
    except (ValueError, IndexError) as error:
        told = {"error": f"{type(error).__name__}: {error}"}
    os.write(answer, json.dumps(told).encode() + b"\n")


def stems(cloud: np.ndarray, clustering: dict, trees: dict, circles: dict) -> list[list[float | None]]:
    """x, y, diameter or None."""
    dtm = dm.clean_cloth(dm.generate_dtm(dm.clean_ground(cloud)))
    cloud = np.column_stack([cloud, dm.normalize_heights(cloud, dtm)])
    stripe = cloud[(cloud[:, 3] > STRIPE_M[0]) & (cloud[:, 3] < STRIPE_M[1])]
    clustered = dm.verticality_clustering(stripe, **clustering)
    assigned, vectors, _ = dm.individualize_trees(
        cloud, clustered, stripe_lower_limit=STRIPE_M[0], stripe_upper_limit=STRIPE_M[1], **trees
    )
    near = assigned[(assigned[:, 5] < AXIS_M) & (assigned[:, 3] > 0.2) & (assigned[:, 3] < 5.2)]
    wood = dm.verticality_clustering(near, **clustering)[:, :6]
    x, y, radius, _, _, share, _ = dm.compute_sections(wood, SECTIONS_M, **circles)
    outliers = dm.tilt_detection(x, y, radius, SECTIONS_M)
    dbh, places = dm.tree_locator(SECTIONS_M, x, y, vectors, share, radius, outliers)
    return [
        [float(at[0]), float(at[1]), float(d) if d > 0 else None]
        for at, d in zip(np.asarray(places), np.ravel(dbh), strict=True)
    ]


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
