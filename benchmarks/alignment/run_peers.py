"""Runs in an environment with open3d and small_gicp, and imports nothing of ours. A line of JSON a run."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np
import open3d as o3d
import small_gicp

VOXEL_M = 0.5
FEATURE_M = 1.0
REACH_M = 3.0
"""Greatest distance of a correspondence of the ICPs."""


def main(folder: Path, *asked: str) -> None:
    """`pair.npz` and `pushes.json` lie in the folder. asked: names of methods."""
    pair = np.load(folder / "pair.npz")
    fixed, moved = pair["fixed"], pair["moved"]
    methods = {
        "icp": lambda a, b: small(a, b, "ICP"),
        "plane": lambda a, b: small(a, b, "PLANE_ICP"),
        "gicp": lambda a, b: small(a, b, "GICP"),
        "fgr": lambda a, b: features(a, b, ransac=False),
        "ransac": lambda a, b: features(a, b, ransac=True),
    }
    o3d.utility.random.seed(1)
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    for push in json.loads((folder / "pushes.json").read_text()):
        true = matrix(*push)
        pushed = apply(np.linalg.inv(true), moved)
        for name in asked:
            start = time.process_time()
            found = methods[name](fixed, pushed)
            spent = time.process_time() - start
            off = found @ np.linalg.inv(true)
            yaw = float(np.degrees(np.arctan2(off[1, 0], off[0, 0])))
            x, y, z = off[:3, 3].tolist()
            print(json.dumps({"method": name, "x": x, "y": y, "z": z, "yaw": yaw, "cpu_s": spent}), flush=True)


def small(fixed: np.ndarray, moved: np.ndarray, kind: str) -> np.ndarray:
    """small_gicp from where the map was put."""
    found = small_gicp.align(
        fixed, moved, registration_type=kind, downsampling_resolution=VOXEL_M,
        max_correspondence_distance=REACH_M, num_threads=1, max_iterations=60,
    )  # fmt: skip
    return np.asarray(found.T_target_source)


def features(fixed: np.ndarray, moved: np.ndarray, *, ransac: bool) -> np.ndarray:
    """open3d, global."""
    (a, fa), (b, fb) = described(fixed), described(moved)
    if not ransac:
        option = o3d.pipelines.registration.FastGlobalRegistrationOption(maximum_correspondence_distance=FEATURE_M)
        found = o3d.pipelines.registration.registration_fgr_based_on_feature_matching(b, a, fb, fa, option)
        return np.asarray(found.transformation)
    checks = [
        o3d.pipelines.registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
        o3d.pipelines.registration.CorrespondenceCheckerBasedOnDistance(FEATURE_M),
    ]
    found = o3d.pipelines.registration.registration_ransac_based_on_feature_matching(
        b, a, fb, fa, True, FEATURE_M, o3d.pipelines.registration.TransformationEstimationPointToPoint(False), 3,
        checks,
        o3d.pipelines.registration.RANSACConvergenceCriteria(50_000, 0.999),
    )  # fmt: skip
    return np.asarray(found.transformation)


def described(points: np.ndarray) -> tuple[o3d.geometry.PointCloud, o3d.pipelines.registration.Feature]:
    """Thinned, with normals and FPFH."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(FEATURE_M)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(3 * FEATURE_M, 30))
    cloud.orient_normals_towards_camera_location([0.0, 0.0, 1e4])
    search = o3d.geometry.KDTreeSearchParamHybrid(6 * FEATURE_M, 100)
    return cloud, o3d.pipelines.registration.compute_fpfh_feature(cloud, search)


def matrix(x: float, y: float, yaw_deg: float) -> np.ndarray:
    """(4, 4) about the middle."""
    c, s = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def apply(transform: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 3)"""
    return points @ transform[:3, :3].T + transform[:3, 3]


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
