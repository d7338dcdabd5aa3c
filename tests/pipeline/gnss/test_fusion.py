"""What must hold of the fusion as a whole, over walks of minutes."""

import math

import numpy as np
import pytest

from drivers.messages import FixQuality
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.fusion import GnssFusion
from tests.pipeline.gnss.walks import SECOND, Walk, fix_at, fused, moved_by, rz, sizes

OFF = np.array([7.0, -7.0, 3.0])


def test_exact_odometry_and_fixes_give_the_exact_place():
    walk = Walk(seconds=120, drift_m=0.0, drift_yaw_deg=0.0)
    fusion, rows = fused(walk, walk.fixes(sigma_m=1e-6, quality=FixQuality.RTK_FIXED))
    state = fusion.state()
    assert state.observable
    assert state.yaw_rad == pytest.approx(walk.yaw, abs=1e-4)
    # Fixes are placed between two estimates by a straight line: 1 mm.
    assert sizes(rows).max() < 5e-3


def test_the_state_and_the_global_pose_tell_the_same():
    walk = Walk(seconds=150)
    fusion, _ = fused(walk, walk.fixes())
    estimate = walk.estimate(-1)
    state, pose = fusion.state(), fusion.global_pose(estimate)
    turn = rz(state.yaw_rad)
    np.testing.assert_allclose(turn @ estimate.position_m + state.translation_m, pose.position_enu_m, atol=1e-9)
    np.testing.assert_allclose(turn @ estimate.rotation, pose.rotation, atol=1e-12)
    arm = turn @ estimate.position_m
    jacobian = np.column_stack([np.eye(3), [-arm[1], arm[0], 0.0]])
    placed = jacobian @ state.covariance @ jacobian.T
    # All but what drifted since the last fix.
    assert np.all(np.diag(pose.covariance)[:3] >= np.diag(placed) - 1e-9)
    assert np.diag(pose.covariance)[:3] == pytest.approx(np.diag(placed), rel=0.1)


def test_without_a_fix_there_is_no_place():
    fusion, rows = fused(Walk(seconds=30), [])
    assert fusion.state() is None
    assert not rows


def test_fixes_that_are_none_are_not_used():
    walk = Walk(seconds=30)
    nowhere = [
        fix_at(stamp, (0.0, 0.0, 0.0), math.nan, FixQuality.INVALID) for stamp in range(0, 29 * SECOND, SECOND // 5)
    ]
    fusion, rows = fused(walk, nowhere)
    assert fusion.state() is None
    assert not rows


def test_standing_still_the_yaw_stays_unknown():
    walk = Walk(seconds=200)
    walk.odom[:], walk.truth[:], walk.way[:] = walk.odom[0], walk.truth[0], 0.0
    fixes = [fix_at(int(s * SECOND), (0.1 * math.sin(s), 0.1 * math.cos(s), 0.0), 0.3) for s in range(199)]
    fusion, rows = fused(walk, fixes)
    assert not rows
    assert not fusion.state().observable
    assert fusion.state().covariance[3, 3] > 9.0
    assert fusion.state().datum is not None


@pytest.mark.parametrize("yaw", [-3.1, 0.0, 1.6, 3.1])
def test_any_heading_is_found(yaw):
    walk = Walk(seconds=200, yaw=yaw)
    fusion, rows = fused(walk, walk.fixes())
    assert math.remainder(fusion.state().yaw_rad - yaw, 2 * math.pi) == pytest.approx(0.0, abs=math.radians(3))
    assert rows[0][0] < 90.0
    assert sizes(rows).mean() < 0.6


def test_the_first_fix_may_come_after_ten_minutes():
    walk = Walk(seconds=800)
    _, rows = fused(walk, walk.fixes(start_s=600))
    assert 605.0 < rows[0][0] < 700.0
    assert sizes(rows, 700).mean() < 0.8


def test_fixes_of_the_first_minute_serve_the_whole_walk():
    walk = Walk(seconds=400)
    fusion, rows = fused(walk, walk.fixes(end_s=70, sigma_m=0.1, quality=FixQuality.RTK_FIXED))
    assert fusion.state().observable
    assert sizes(rows).mean() < 2.0
    early, late = (next(cov for t, _, cov in rows if t > after) for after in (75.0, 390.0))
    assert np.trace(late[:3, :3]) > 4.0 * np.trace(early[:3, :3])
    _, error, covariance = rows[-1]
    assert error @ np.linalg.solve(covariance[:3, :3], error) < 16.3


def test_the_covariance_is_honest():
    """Normalised estimation error squared, three degrees of freedom, over independent walks."""
    errors = []
    for seed in range(5):
        walk = Walk(seconds=240, seed=seed)
        _, rows = fused(walk, walk.fixes())
        errors += [error @ np.linalg.solve(cov[:3, :3], error) for t, error, cov in rows[::40] if t > 100]
    assert 0.7 < np.mean(errors) < 5.0


def test_spikes_are_not_followed():
    walk = Walk(seconds=300)
    clean = walk.fixes()
    spiked = [moved_by(fix, OFF) if k % 25 == 0 and k > 400 else fix for k, fix in enumerate(clean)]
    _, before = fused(walk, clean)
    _, rows = fused(walk, spiked)
    assert sizes(rows).mean() < sizes(before).mean() + 0.05
    assert sizes(rows).max() < sizes(before).max() + 0.2


def test_ten_seconds_of_offset_are_not_followed():
    walk = Walk(seconds=300)
    fixes = [moved_by(fix, OFF) if 150 <= fix.stamp_ns / 1e9 < 160 else fix for fix in walk.fixes()]
    fusion, rows = fused(walk, fixes)
    assert sizes(rows).max() < 1.5
    assert fusion.state().fixes_rejected >= 8


def test_squared_loss_without_gate_would_follow_them():
    walk = Walk(seconds=300, config=FusionConfig(huber=math.inf, gate=math.inf, learning_rate=0.0))
    fixes = [moved_by(fix, OFF) if 150 <= fix.stamp_ns / 1e9 < 160 else fix for fix in walk.fixes()]
    assert sizes(fused(walk, fixes)[1]).max() > 2.0


def test_a_filter_that_is_wrong_recovers():
    """From 150 s on the odometry lies 12 m off: every fix contradicts it, until the filter doubts itself."""
    walk = Walk(seconds=400)
    walk.odom[1500:] += [12.0, 0.0, 0.0]
    fusion, rows = fused(walk, walk.fixes())
    assert sizes(rows, 280).mean() < 1.0
    assert fusion.state().fixes_rejected > 20


def test_a_sudden_turn_of_the_odometry_is_found():
    walk = Walk(seconds=400)
    turn = rz(math.radians(25.0))
    walk.odom[1500:] = (walk.odom[1500:] - walk.odom[1500]) @ turn.T + walk.odom[1500]
    walk.rotations[1500:] = turn @ walk.rotations[1500:]
    fusion, rows = fused(walk, walk.fixes())
    assert sizes(rows, 300).mean() < 1.0
    assert math.degrees(fusion.state().yaw_rad - walk.yaw) == pytest.approx(-25.0, abs=5.0)


def test_half_a_minute_of_wrong_fixes_does_not_make_it_doubt():
    walk = Walk(seconds=250)
    fixes = [moved_by(fix, OFF) if 150 <= fix.stamp_ns / 1e9 < 190 else fix for fix in walk.fixes()]
    assert sizes(fused(walk, fixes)[1]).max() < 1.5


def test_odometry_that_begins_anew_is_aligned_anew_to_the_same_datum():
    walk = Walk(seconds=300)
    walk.odom[1500:] = (walk.odom[1500:] - walk.odom[1500]) @ rz(1.0).T
    walk.rotations[1500:] = rz(1.0) @ walk.rotations[1500:]
    walk.way[1500:] -= walk.way[1500]
    _, rows = fused(walk, walk.fixes())
    times = [t for t, _, _ in rows]
    assert not any(150.0 <= t < 155.0 for t in times)
    assert sizes(rows, 250).mean() < 0.8


def test_a_fix_of_the_future_does_not_hold_up_the_others():
    walk = Walk(seconds=120)
    fixes = walk.fixes()
    lost = fix_at(10**6 * SECOND, (0.0, 0.0, 0.0), 0.3)
    fusion = GnssFusion(walk.config)
    fusion.add_fix(lost)
    for estimate in walk.estimates():
        while fixes and fixes[0].stamp_ns <= estimate.stamp_ns + SECOND:
            fusion.add_fix(fixes.pop(0))
        fusion.add_odometry(estimate)
    assert fusion.state().fixes_used > 100


def test_dishonest_sigmas_are_found_out():
    walk = Walk(seconds=400, config=FusionConfig(sigma_floor_m=(0.01, 0.02, 0.05)))
    fixes = walk.fixes(sigma_m=1.0, said=0.1)
    learned = sizes(fused(walk, fixes)[1], 200).mean()
    walk.config = FusionConfig(sigma_floor_m=(0.01, 0.02, 0.05), learning_rate=0.0)
    believed = sizes(fused(walk, fixes)[1], 200).mean()
    assert learned < 0.9 * believed
    assert learned < 1.6


def test_a_fix_counts_where_it_was_measured_not_when_it_came():
    walk = Walk(seconds=200, drift_m=0.0, drift_yaw_deg=0.0)
    fixes = walk.fixes(sigma_m=0.02, quality=FixQuality.RTK_FIXED)
    fusion, rows = fused(walk, fixes, delay_ns=3 * SECOND)
    assert sizes(rows, 60).max() < 0.15
    assert fusion.state().fixes_rejected == 0


def test_a_fix_ahead_of_the_odometry_waits():
    walk = Walk(seconds=120)
    in_time, _ = fused(walk, walk.fixes())
    ahead, _ = fused(walk, walk.fixes(), delay_ns=-SECOND)
    assert ahead.state().translation_m == pytest.approx(in_time.state().translation_m, abs=1e-9)


def test_a_fix_from_before_the_history_is_refused():
    walk = Walk(seconds=120)
    fusion, _ = fused(walk, walk.fixes())
    used = fusion.state().fixes_used
    fusion.add_fix(fix_at(-SECOND, (0.0, 0.0, 0.0), 0.3))
    assert fusion.state().fixes_used == used
    assert fusion.state().fixes_rejected >= 1


def test_after_a_silence_the_pose_does_not_leap():
    walk = Walk(seconds=300)
    fixes = [fix for fix in walk.fixes() if not 150 <= fix.stamp_ns / 1e9 < 180]
    _, rows = fused(walk, fixes, every=1)
    errors = np.array([error for t, error, _ in rows if t > 100])
    assert np.linalg.norm(np.diff(errors, axis=0), axis=1).max() < 0.5
    sigma = {round(t, 1): np.sqrt(np.trace(cov[:3, :3])) for t, _, cov in rows}
    assert sigma[179.0] > sigma[149.0]


def test_degenerate_odometry_is_expected_to_drift_more():
    walk = Walk(seconds=150)
    fusion, _ = fused(walk, walk.fixes(end_s=100))
    good = fusion.global_pose(walk.estimate(-1)).covariance
    degenerate = GnssFusion(walk.config)
    fixes = walk.fixes(end_s=100)
    for k in range(len(walk.stamps)):
        degenerate.add_odometry(walk.estimate(k, degenerate=k > 1050))
        while fixes and fixes[0].stamp_ns <= walk.stamps[k]:
            degenerate.add_fix(fixes.pop(0))
    assert degenerate.global_pose(walk.estimate(-1)).covariance[0, 0] > 2.0 * good[0, 0]


def test_the_antenna_is_not_the_imu():
    config = FusionConfig(antenna_m=(1.0, 0.5, 2.0))
    walk = Walk(seconds=120, drift_m=0.0, drift_yaw_deg=0.0, config=config)
    _, rows = fused(walk, walk.fixes(sigma_m=1e-3, quality=FixQuality.RTK_FIXED))
    assert sizes(rows, 60).max() < 0.1


def test_the_same_input_gives_the_same_output():
    walk = Walk(seconds=150)
    a, b = (fused(walk, walk.fixes())[0].global_pose(walk.estimate(-1)) for _ in range(2))
    assert np.array_equal(a.position_enu_m, b.position_enu_m)
    assert np.array_equal(a.covariance, b.covariance)
