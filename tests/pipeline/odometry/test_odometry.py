"""The odometry over the first half minute of a simulated walk: ten seconds at rest, then on foot."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.odometry.simulated import SCAN_NS, walk
from drivers.sim.scenarios import scenario
from pipeline.evaluation.trajectory import Trajectory, aligned
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.estimate import Status
from pipeline.odometry.odometry import LidarInertialOdometry

SECONDS = 26.0


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    made = walk(scenario("demo"), tmp_path_factory.mktemp("walk"), longest_s=SECONDS)
    return list(made.scans()), made.imu(), made.truth()


def run(scans, imu):
    """As the sweeps come: samples of a sweep, then the sweep."""
    odometry, found, used = LidarInertialOdometry(OdometryConfig()), [], 0
    for scan in scans:
        while used < len(imu) and imu[used].stamp_ns <= scan.stamp_ns + SCAN_NS + 10_000_000:
            odometry.offer_imu(imu[used])
            used += 1
        odometry.offer_scan(scan)
        found += odometry.take()
    return [*found, *odometry.take(flush=True)], odometry


def errors_m(found, truth):
    """Distance from the truth, the whole laid over it by its heading alone: `odom` is level, and starts anywhere."""
    stamps, position, quaternion, _ = truth
    true = Trajectory(stamps, position, Rotation.from_quat(quaternion).as_matrix())
    at = np.array([one.stamp_ns for one in found])
    estimate = Trajectory(at, np.array([o.position_m for o in found]), np.array([o.rotation for o in found]))
    laid, true = aligned(estimate, true.at(at), "yaw"), true.at(at)
    return np.linalg.norm(laid.positions_m - true.positions_m, axis=1), true.positions_m


@pytest.fixture(scope="module")
def tracked(simulated):
    scans, imu, _ = simulated
    return run(scans, imu)[0]


def test_a_walk_is_followed_within_centimetres_and_the_sigma_covers_it(simulated, tracked):
    error, true = errors_m(tracked, simulated[2])
    assert len(tracked) > 10 * (SECONDS - 3)
    assert np.linalg.norm(true[-1] - true[0]) > 5.0  # it did walk
    assert error.max() < 0.05
    sigma = np.sqrt(np.trace(tracked[-1].covariance[3:6, 3:6]))
    assert error[-1] < 4.0 * sigma
    assert sigma < 0.5


def test_the_same_input_gives_the_same_poses(simulated, tracked):
    scans, imu, _ = simulated
    again = run(scans[:120], imu)[0]
    assert all(
        np.array_equal(a.position_m, b.position_m) and np.array_equal(a.rotation, b.rotation)
        for a, b in zip(again[:100], tracked[:100], strict=True)
    )


def test_a_laser_silent_for_two_seconds_does_not_lose_the_way(simulated):
    scans, imu, truth = simulated
    found, _ = run([scan for k, scan in enumerate(scans) if not 170 <= k < 190], imu)
    error, _ = errors_m(found, truth)
    assert error[-20:].max() < 0.5


def test_without_inertial_samples_nothing_is_claimed(simulated):
    scans, _, _ = simulated
    found, odometry = run(scans[:30], [])
    assert found == []
    assert odometry.refusal


def test_an_inertial_gap_is_told(simulated):
    scans, imu, _ = simulated
    begin = scans[170].stamp_ns
    heard = [sample for sample in imu if not begin < sample.stamp_ns < begin + 700_000_000]
    found, _ = run(scans, heard)
    told = [one for one in found if one.gap_s > 0 or one.status in {Status.RESTARTED, Status.COASTING}]
    assert told
    assert all(one.note or one.gap_s > 0 for one in told)
