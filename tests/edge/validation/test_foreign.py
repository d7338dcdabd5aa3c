"""Bags written by the rosbags library, which has its own MCAP writer."""

from collections import Counter

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from edge.recording.recover import recover
from edge.validation.info import info
from edge.validation.validate import validate
from tests.edge.recordings import read_messages, rosbags_counts

STORE = get_typestore(Stores.ROS2_HUMBLE)
S = 1_000_000_000


def bag(folder, seconds=10, skip=()):
    """100 Hz Imu and 10 Hz PointCloud2."""
    t = STORE.types
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        clouds = writer.add_connection("/points", "sensor_msgs/msg/PointCloud2", typestore=STORE)
        inertial = writer.add_connection("/imu/data", "sensor_msgs/msg/Imu", typestore=STORE)
        for k in range(seconds * 100):
            at = 1_700_000_000 * S + k * S // 100
            if k in skip:
                continue
            stamp = t["builtin_interfaces/msg/Time"](at // S, at % S)
            header = t["std_msgs/msg/Header"](stamp, "imu")
            zero, none = t["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0), np.zeros(9)
            turn = t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            message = t["sensor_msgs/msg/Imu"](header, turn, none, zero, none, zero, none)
            writer.write(inertial, at, STORE.serialize_cdr(message, message.__msgtype__))
            if k % 10 == 0:
                octets = np.zeros(16 * 20, np.uint8)
                cloud = t["sensor_msgs/msg/PointCloud2"](header, 1, 20, [], False, 16, 320, octets, True)
                writer.write(clouds, at, STORE.serialize_cdr(cloud, cloud.__msgtype__))
    return folder


def test_a_foreign_bag_is_judged_and_listed(tmp_path):
    folder = bag(tmp_path / "bag")
    report = validate(folder)
    assert report.verdict == "PASS", report.reasons
    assert not report.own
    expected = {topic.name: topic.expected_hz for topic in report.topics}
    assert expected == {"/imu/data": pytest.approx(100), "/points": pytest.approx(10)}
    found = info([folder])
    assert {topic.name: topic.count for topic in found.topics} == {"/imu/data": 1000, "/points": 100}
    assert found.files[0].compression == "zstd"
    assert found.session == {}


def test_a_hole_in_a_foreign_bag_is_found(tmp_path):
    report = validate(bag(tmp_path / "bag", skip=range(300, 450)))
    assert report.verdict == "WARN"
    assert "silent for 1.51 s at second 3.0 (/imu/data)" in " ".join(report.reasons)


def test_a_foreign_bag_is_recovered(tmp_path):
    path = next(bag(tmp_path / "bag").glob("*.mcap"))
    whole = Counter(read_messages(path))
    assert recover(path, tmp_path / "copy.mcap").lossless
    assert Counter(read_messages(tmp_path / "copy.mcap")) == whole
    assert rosbags_counts(tmp_path / "copy.mcap") == {"/imu/data": 1000, "/points": 100}
