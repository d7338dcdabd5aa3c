"""Whether the covariances are worth what they say, over independent groves."""

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from pipeline.odometry import so3
from pipeline.odometry.cluster_kernels import cluster
from pipeline.odometry.imu_buffer import ImuBuffer
from pipeline.odometry.initialise import start_at_rest
from pipeline.odometry.odometry import LidarInertialOdometry
from pipeline.odometry.tracker import Tracker
from tests.pipeline.odometry.grove import EPOCH_NS, Grove

SEEDS, EVERY = range(2), 6
"""Poses 0.6 s apart: their errors are hardly correlated."""


def pose(grove, stamp_ns):
    position, rotation = grove.poses(np.array([(stamp_ns - EPOCH_NS) * 1e-9]))
    return position[0], rotation[0].as_matrix()


def end_of(scan):
    return scan.stamp_ns + int(scan.offset_ns.max())


def true_map(tracker, grove):
    """The scans of a round, put where they were seen from."""
    slots, owners = np.empty(1 << 14, np.int64), np.empty(1 << 14, np.int32)
    for scan in grove.scans():
        places, turns = grove.poses((scan.stamp_ns - EPOCH_NS + scan.offset_ns.astype(np.int64)) * 1e-9)
        position, rotation = pose(grove, end_of(scan))
        seen = (turns.apply(scan.xyz_m.astype(np.float64)) + places - position) @ rotation
        found = cluster(seen, scan.reflectivity, rotation, position, 0.3, slots, owners)
        tracker.map.insert(found, rotation, position)


def errors_in_a_true_map(seed):
    """Errors (n, 6) of attitude and position, and covariances, of a walk through a map without error."""
    grove, imu = Grove(seed), ImuBuffer()
    for sample in grove.imu():
        imu.add(sample)
    started = start_at_rest(imu.window(EPOCH_NS, EPOCH_NS + 10**9), grove.config)
    tracker = Tracker(grove.config, started)
    true_map(tracker, grove)
    position, rotation = pose(grove, EPOCH_NS)
    turned = rotation @ started.state.rotation.T
    gravity = turned @ started.state.gravity_m_s2
    tracker.filter.state = replace(started.state, position_m=position, rotation=rotation, gravity_m_s2=gravity)
    errors, covariances, since_ns = [], [], EPOCH_NS
    for k, scan in enumerate(grove.scans()):
        tracker.track(scan, imu.between(since_ns, end_of(scan), scan.stamp_ns))
        since_ns, state = end_of(scan), tracker.filter.state
        if k > 15 and k % EVERY == 0:
            position, rotation = pose(grove, since_ns)
            errors.append(np.concatenate([so3.log(state.rotation.T @ rotation), position - state.position_m]))
            covariances.append(tracker.filter.covariance[:6, :6])
    return np.array(errors), np.array(covariances)


def nees(errors, covariances):
    return np.einsum("ni,ni->n", errors, np.linalg.solve(covariances, errors[..., None])[..., 0])


def test_within_its_map_the_pose_is_as_sure_as_it_says():
    """Normalised squared errors, six degrees of freedom: never overconfident, and within a factor of three of honest.

    On the safe side on purpose: the information of a scan is counted as that of 300 residuals.
    """
    found = np.concatenate([nees(*errors_in_a_true_map(seed)) for seed in SEEDS])
    assert found.sum() < chi2.ppf(0.95, 6 * len(found))
    assert found.mean() > 6.0 / 3.0**2
    assert found.max() < chi2.ppf(1.0 - 1e-4, 6)


def test_what_is_published_covers_the_drift_of_the_map():
    found = []
    for seed in SEEDS:
        grove = Grove(seed)
        odometry = LidarInertialOdometry(grove.config)
        for sample in grove.imu():
            odometry.offer_imu(sample)
        for scan in grove.scans():
            odometry.offer_scan(scan)
        estimates = list(odometry.take(flush=True))
        true = [pose(grove, one.stamp_ns) for one in estimates]
        turn = true[8][1] @ estimates[8].rotation.T
        turn = so3.exp(np.array([0.0, 0.0, np.arctan2(turn[1, 0], turn[0, 0])]))
        errors = np.array([t - turn @ one.position_m for (t, _), one in zip(true, estimates, strict=True)])
        errors = (errors - errors[8]) @ turn
        covariances = np.array([one.covariance[3:6, 3:6] for one in estimates])
        found.append(nees(errors, covariances)[20::EVERY])
        assert np.linalg.norm(errors[-1]) < 0.1
    assert np.concatenate(found).sum() < chi2.ppf(0.95, 3 * sum(map(len, found)))
