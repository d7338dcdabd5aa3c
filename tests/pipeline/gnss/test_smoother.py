import math

import numpy as np
import pytest

from drivers.messages import FixQuality
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.smoother import smooth
from tests.pipeline.gnss.walks import HOME, Walk, fused, moved_by, sizes


def smoothed_rows(walk, fixes, every=5):
    drift = smooth(walk.estimates(), fixes, walk.config)
    asked = range(0, len(walk.stamps), every)
    poses = [drift.pose(walk.estimate(k)) for k in asked]
    places = [HOME.enu(*drift.datum.geodetic(pose.position_enu_m)) for pose in poses]
    return [
        (stamp / 1e9, place - truth, pose.covariance)
        for stamp, place, truth, pose in zip(walk.stamps[asked], places, walk.truth[asked], poses, strict=True)
    ]


def test_it_is_the_batch_least_squares_solution():
    """Oracle: with exact odometry nothing drifts, so one rigid transform fits all fixes."""
    config = FusionConfig(
        drift_m=1e-6, drift_up_m=1e-6, drift_yaw_deg=1e-7, drift_scales=(1.0,), correlation_s=0.0, huber=math.inf
    )
    walk = Walk(seconds=150, drift_m=0.0, drift_yaw_deg=0.0, config=config)
    fixes = [fix for fix in walk.fixes(lasting_s=0.0) if fix.stamp_ns % 10**9 == 0]
    drift = smooth(walk.estimates(), fixes, config)
    found = np.array([drift.datum.enu(fix.latitude_deg, fix.longitude_deg, fix.height_m) for fix in fixes])
    odom = np.array([knot.sighting.passage.antenna_m for knot in drift.knots])
    e, g = odom - odom.mean(0), found - found.mean(0)
    yaw = math.atan2(np.sum(e[:, 0] * g[:, 1] - e[:, 1] * g[:, 0]), np.sum(e[:, :2] * g[:, :2]))
    # The prior, three sigmas of the first alignment, is not quite nothing.
    assert drift.knots[0].mean[3] == pytest.approx(yaw, abs=1e-3)
    assert drift.knots[-1].mean[3] == pytest.approx(drift.knots[0].mean[3], abs=1e-6)


def test_it_is_better_than_the_filter_and_covers_the_beginning():
    walk = Walk(seconds=400)
    fixes = walk.fixes()
    rows = smoothed_rows(walk, fixes)
    assert rows[0][0] == 0.0
    assert sizes(rows).mean() < sizes(fused(walk, fixes)[1]).mean()


def test_its_covariance_is_honest():
    errors = []
    for seed in range(4):
        walk = Walk(seconds=240, seed=seed)
        errors += [e @ np.linalg.solve(cov[:3, :3], e) for _, e, cov in smoothed_rows(walk, walk.fixes(), every=200)]
    assert 0.7 < np.mean(errors) < 5.0


def test_an_offset_early_in_the_session_is_seen_through():
    walk = Walk(seconds=300)
    fixes = [moved_by(fix, (8.0, 6.0, 3.0)) if 20 <= fix.stamp_ns / 1e9 < 30 else fix for fix in walk.fixes()]
    assert sizes(smoothed_rows(walk, fixes)).max() < 1.5


def test_the_drift_of_the_odometry_is_recognised():
    scales = {}
    for drift_m in (0.002, 0.15):
        walk = Walk(seconds=400, drift_m=drift_m, drift_yaw_deg=0.0)
        drift = smooth(walk.estimates(), walk.fixes(sigma_m=0.1, quality=FixQuality.RTK_FIXED), walk.config)
        scales[drift_m] = np.sqrt(drift.knots[200].covariance[0, 0])
    assert scales[0.002] < scales[0.15]


def test_poses_go_on_smoothly_over_a_silence():
    walk = Walk(seconds=300)
    rows = smoothed_rows(walk, [fix for fix in walk.fixes() if not 150 <= fix.stamp_ns / 1e9 < 180], every=1)
    errors = np.array([error for _, error, _ in rows])
    assert np.linalg.norm(np.diff(errors, axis=0), axis=1).max() < 0.12
    sigma = {round(t, 1): np.sqrt(np.trace(cov[:3, :3])) for t, _, cov in rows}
    assert sigma[165.0] > sigma[149.0]


def test_too_few_fixes_tell_no_yaw():
    walk = Walk(seconds=60)
    assert smooth(walk.estimates(), [], walk.config) is None
    assert smooth(walk.estimates(), walk.fixes(end_s=2), walk.config) is None
