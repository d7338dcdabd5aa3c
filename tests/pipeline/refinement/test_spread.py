"""What the keyframes were corrected by reaches every sweep, and every point that it saw."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gtsam", reason="GTSAM has no wheel for this Python")

from scipy.spatial.transform import Rotation

from pipeline.gnss.config import FusionConfig
from pipeline.refinement.config import ChainConfig, RefinementConfig
from pipeline.refinement.keyframes import Poses, keyframes
from pipeline.refinement.session import Problem, Session
from pipeline.refinement.solver import Solver
from pipeline.refinement.spread import placement
from tests.pipeline.refinement import walks

CHAIN = ChainConfig(drift_scales=(1.0,))


def test_points_far_off_the_way_are_where_they_are_although_the_odometry_tilts():
    """`odom` leans by up to 0.3 degrees, to one side and then to the other: 16 cm at 30 m."""
    way = walks.circle()
    true = walks.odometry(*way, drift_m=0.0, drift_yaw_deg=0.0)
    lean = Rotation.from_euler("x", 0.3 * np.sin(np.linspace(0.0, 6.28, len(true)))[:, None], degrees=True)
    track = true.copy()
    track["rotation"] = lean.as_matrix() @ true["rotation"]
    seen = Rotation.from_euler("z", np.arange(len(true))[:, None]).as_matrix() @ [30.0, 0.0, 5.0]
    world, odom = (one["position_m"] + np.einsum("nij,nj->ni", one["rotation"], seen) for one in (true, track))
    solved = solution(track, true)
    found = placement(track, solved).points(odom, np.arange(len(track)))
    assert np.linalg.norm(found - world, axis=1).max() < 0.005
    assert np.linalg.norm(odom - world, axis=1).max() > 0.15
    positions, rotations = placement(track, solved).poses(track)
    np.testing.assert_allclose(positions, true["position_m"], atol=1e-3)
    np.testing.assert_allclose(rotations, true["rotation"], atol=2e-4)


def solution(track, true):
    """That has found the truth."""
    given = Problem((Session(track, [], FusionConfig()),), RefinementConfig(chain=CHAIN))
    open_way = Solver(given).solve()
    index = keyframes(track, CHAIN).index
    return type(open_way)(
        open_way.frames,
        Poses(true["position_m"][index], true["rotation"][index]),
        open_way.covariance,
        None,
        None,
        1.0,
    )
