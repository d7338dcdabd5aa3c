"""Decoders: what was encoded comes back, what others encode is read, and garbage is refused in words."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_ros2._dynamic import serialize_dynamic

from drivers.messages import FixQuality, GnssFix, ImuSample, LidarScan, NmeaSentence, SensorEvent, Severity, VideoFrame
from edge.errors import FormatError
from edge.recording.messages import Diagnostics, DiagnosticStatus, Level
from edge.ros import decode, encode, schemas
from edge.ros.frames import Transform

STAMP = 1_790_000_000_000_000_256
FLOATS = st.floats(allow_nan=False, allow_infinity=False)
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
TEXT = st.text(st.characters(blacklist_characters="\x00", blacklist_categories=("Cs",)), max_size=60)


@given(st.integers(0, 40), st.integers(0, 2**32 - 1))
def test_cloud_round_trip(count, seed):
    rng = np.random.default_rng(seed)
    octets = rng.integers(0, 256, (3, count)).astype(np.uint8)
    offsets = rng.integers(0, 10**8, count).astype(np.uint32)
    scan = LidarScan(0, 0, rng.normal(0, 9, (count, 3)).astype(np.float32), *octets, offsets)
    cloud = decode.decode_point_cloud(encode.encode_scan(scan, STAMP))
    assert (cloud.stamp_ns, cloud.frame_id, cloud.width, cloud.is_dense) == (STAMP, "livox_frame", count, True)
    np.testing.assert_array_equal(np.stack([cloud.points[axis] for axis in "xyz"], 1), scan.xyz_m)
    np.testing.assert_array_equal(cloud.points["tag"], scan.tag)
    assert np.all(np.abs(cloud.points["timestamp"] - (STAMP + offsets.astype(np.int64))) <= 256)


def test_cloud_of_others_with_padding_rows_and_big_endian():
    points = np.zeros((2, 3), np.dtype({"names": ["x", "ring"], "formats": [">f4", ">u2"], "itemsize": 12}))
    points["x"] = [[1, 2, 3], [4, 5, 6]]
    points["ring"] = [[7, 8, 9], [10, 11, 12]]
    rows = b"".join(row.tobytes() + b"pad!" for row in points)
    message = {
        "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "velodyne"},
        "height": 2,
        "width": 3,
        "fields": [
            {"name": "x", "offset": 0, "datatype": 7, "count": 1},
            {"name": "ring", "offset": 4, "datatype": 4, "count": 1},
        ],
        "is_bigendian": True,
        "point_step": 12,
        "row_step": 40,
        "data": rows,
        "is_dense": False,
    }
    encoder = serialize_dynamic(schemas.POINT_CLOUD, schemas.schema_text(schemas.POINT_CLOUD).decode())
    cloud = decode.decode_point_cloud(encoder[schemas.POINT_CLOUD](message))
    assert cloud.points["x"].tolist() == [1, 2, 3, 4, 5, 6]
    assert cloud.points["ring"].tolist() == [7, 8, 9, 10, 11, 12]


@given(STAMPS, st.tuples(FLOATS, FLOATS, FLOATS), st.tuples(FLOATS, FLOATS, FLOATS))
def test_imu_round_trip(stamp, gyro, accel):
    imu = decode.decode_imu(encode.encode_imu(ImuSample(0, 0, gyro, accel), stamp))
    assert (imu.stamp_ns, imu.angular_velocity, imu.linear_acceleration) == (stamp, gyro, accel)
    assert imu.orientation_covariance[0] == -1


@given(FLOATS, FLOATS, FLOATS, st.sampled_from(list(FixQuality)))
def test_fix_round_trip(latitude, longitude, height, quality):
    fix = GnssFix(0, 0, 0, False, quality, latitude, longitude, height, 0.0, 4, 1.0, None, (1.0, 2.0, 3.0), "gst")
    decoded = decode.decode_fix(encode.encode_fix(fix, STAMP))
    assert (decoded.latitude_deg, decoded.longitude_deg, decoded.altitude_m) == (latitude, longitude, height)
    assert (decoded.status == -1) == (quality is FixQuality.INVALID)
    assert decoded.covariance[::4] == ((0.0,) * 3 if quality is FixQuality.INVALID else (1.0, 4.0, 9.0))


@given(TEXT, st.binary(max_size=64))
def test_text_and_video_round_trip(text, data):
    assert decode.decode_sentence(encode.encode_sentence(NmeaSentence(0, 0, text), STAMP)).sentence == text
    assert decode.decode_video(encode.encode_video(VideoFrame(0, 0, data, False, 0), STAMP)).data == data
    log = decode.decode_log(encode.encode_event(SensorEvent(0, 0, "reach", Severity.ERROR, text), STAMP))
    assert (log.stamp_ns, log.level, log.name, log.text, log.function) == (STAMP, 40, "reach", text, "event")


def test_diagnostics_and_transforms_round_trip():
    status = DiagnosticStatus("disk", Level.WARN, "nearly full", "sd", (("free", "2 GiB"), ("flush_ms", "8")))
    decoded = decode.decode_diagnostics(encode.encode_diagnostics(Diagnostics(0, 0, (status, status)), STAMP))
    assert [(one.name, one.level, one.values) for one in decoded.statuses] == [("disk", 1, status.values)] * 2
    transforms = [Transform("base_link", "camera", (1.0, 2.0, 3.0), (0.5, -0.5, 0.5, -0.5))] * 2
    stamped = decode.decode_transforms(encode.encode_transforms(transforms, STAMP))
    assert stamped == [(STAMP, one) for one in transforms]


@given(st.sampled_from(list(decode.DECODERS)), st.binary(max_size=400), st.booleans())
def test_garbage_is_refused_or_decoded_never_crashes(type_name, data, with_header):
    with suppress(FormatError):
        decode.DECODERS[type_name](b"\x00\x01\x00\x00" + data if with_header else data)


def test_truncation_is_refused():
    whole = encode.encode_imu(ImuSample(0, 0, (1, 2, 3), (4, 5, 6)), STAMP)
    with pytest.raises(FormatError, match="ends early"):
        decode.decode_imu(whole[:-1])
