"""What a live pipeline had recorded is read back as it was estimated, at its place on the Earth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from edge.config import Config
from edge.errors import FormatError
from edge.replay.poses import read_live_poses
from pipeline.gnss.geodesy import Datum, ecef, geodetic
from tests.edge import live_recordings
from tests.edge.recording.recording_scene import UTC_NS, second

COUNT = 8
FIRST, SECOND = Datum(47.0, 8.0, 500.0), Datum(47.0003, 8.0002, 512.0)
"""Of the pipeline, and of the same after it was started again on the way."""
AT = np.random.default_rng(2).normal(0, 20, (COUNT, 3))
TURNS = Rotation.random(COUNT, np.random.default_rng(3)).as_matrix()
STAMPS = np.arange(1, COUNT + 1) * 10**8
COVARIANCE = np.diag([0.04, 0.09, 0.25, 1e-4, 2e-4, 3e-4])
COVARIANCE[0, 1] = COVARIANCE[1, 0] = 0.03


def datum(k: int) -> Datum:
    return FIRST if k < 5 else SECOND


@pytest.fixture(scope="module")
def poses(tmp_path_factory):
    sent = [
        message
        for k, (stamp, at, turn) in enumerate(zip(STAMPS.tolist(), AT, TURNS, strict=True))
        for message in live_recordings.told(stamp, turn, COVARIANCE, odom_m=at - AT[0], map_m=at, datum=datum(k))
    ]
    again = sent[-3:]  # a result that came twice
    return read_live_poses(live_recordings.record(tmp_path_factory.mktemp("live"), [*sent, *again]), Config())


def test_the_odometry_comes_back_as_it_was(poses):
    np.testing.assert_array_equal(poses.odom.stamps_ns, STAMPS + UTC_NS)
    np.testing.assert_allclose(poses.odom.positions_m, AT - AT[0])
    np.testing.assert_allclose(poses.odom.rotations, TURNS, atol=1e-12)
    np.testing.assert_allclose(poses.odom.covariance, np.tile(COVARIANCE[:3, :3], (COUNT, 1, 1)), atol=1e-15)


def test_each_pose_in_map_is_on_the_earth_by_the_datum_of_its_time(poses):
    for k in range(COUNT):
        expected = datum(k).geodetic(AT[k])
        found = geodetic(poses.earth.positions_m[k])
        np.testing.assert_allclose(found[:2], expected[:2], atol=1e-11)
        assert found[2] == pytest.approx(expected[2], abs=1e-6)


@pytest.mark.parametrize(("k", "at"), [(0, FIRST), (COUNT - 1, SECOND)])
def test_up_in_map_is_up_on_the_earth_for_rotations_and_covariances(poses, k, at):
    place = (at.latitude_deg, at.longitude_deg)
    up = ecef(*place, at.height_m + 1.0) - ecef(*place, at.height_m)
    up_in_body = TURNS[k].T @ [0.0, 0.0, 1.0]
    np.testing.assert_allclose(poses.earth.rotations[k] @ up_in_body, up, atol=1e-8)
    assert up @ poses.earth.covariance[k] @ up == pytest.approx(0.25)


def test_a_recording_without_live_poses_has_none_and_a_folder_without_recording_is_an_error(tmp_path):
    poses = read_live_poses(live_recordings.record(tmp_path, second(0)), Config())
    assert poses.odom is None
    assert poses.earth is None
    (tmp_path / "empty").mkdir()
    with pytest.raises(FormatError, match="no recording"):
        read_live_poses(tmp_path / "empty", Config())
