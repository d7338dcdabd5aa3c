"""Encoders against two independent ones: `mcap_ros2`, byte for byte, and `rosbags`, which decodes."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_ros2._dynamic import serialize_dynamic
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from drivers.messages import (
    FixQuality,
    GnssFix,
    ImuSample,
    LidarScan,
    NmeaSentence,
    SensorEvent,
    Severity,
    VideoFrame,
)
from edge.recording.messages import Diagnostics, DiagnosticStatus, Level, Mark
from edge.ros import encode, schemas
from edge.ros.frames import Transform

STAMP = 1_790_000_000_123_456_789
UNKNOWN = [0.0] * 9
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
TEXT = st.text(st.characters(blacklist_characters="\x00", blacklist_categories=("Cs",)), max_size=80)


def record(**fields):
    return SimpleNamespace(**fields)


def header(frame, stamp=STAMP):
    return record(stamp=time_of(stamp), frame_id=frame)


def time_of(stamp):
    return record(sec=stamp // 10**9, nanosec=stamp % 10**9)


def vector(values, names="xyz"):
    return record(**dict(zip(names, values, strict=True)))


def oracle(type_name, message):
    return serialize_dynamic(type_name, schemas.schema_text(type_name).decode())[type_name](message)


def rosbags_decoded(type_name, data):
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schemas.schema_text(type_name).decode(), type_name))
    return store.deserialize_cdr(data, type_name)


def scan(count, seed=0):
    rng = np.random.default_rng(seed)
    return LidarScan(
        stamp_ns=5,
        receive_ns=6,
        xyz_m=rng.normal(0, 10, (count, 3)).astype(np.float32),
        reflectivity=rng.integers(0, 256, count).astype(np.uint8),
        tag=rng.integers(0, 64, count).astype(np.uint8),
        line=rng.integers(0, 4, count).astype(np.uint8),
        offset_ns=np.sort(rng.integers(0, 100_000_000, count)).astype(np.uint32),
    )


def cloud_oracle(cloud):
    points = b"".join(
        np.array([*xyz, intensity], "<f4").tobytes()
        + bytes([tag, line])
        + np.array([STAMP + int(offset)], "<i8").astype("<f8").tobytes()
        for xyz, intensity, tag, line, offset in zip(
            cloud.xyz_m, cloud.reflectivity, cloud.tag, cloud.line, cloud.offset_ns, strict=True
        )
    )
    layout = [
        ("x", 0, 7),
        ("y", 4, 7),
        ("z", 8, 7),
        ("intensity", 12, 7),
        ("tag", 16, 2),
        ("line", 17, 2),
        ("timestamp", 18, 8),
    ]
    return record(
        header=header("livox_frame"),
        height=1,
        width=len(cloud.xyz_m),
        fields=[record(name=name, offset=offset, datatype=kind, count=1) for name, offset, kind in layout],
        is_bigendian=False,
        point_step=26,
        row_step=len(points),
        data=points,
        is_dense=True,
    )


@pytest.mark.parametrize("count", [0, 1, 7, 200])
def test_scan_equals_generic_encoder(count):
    cloud = scan(count)
    assert encode.encode_scan(cloud, STAMP) == oracle(schemas.POINT_CLOUD, cloud_oracle(cloud))


def test_scan_decodes_in_rosbags():
    cloud = scan(50)
    message = rosbags_decoded(schemas.POINT_CLOUD, encode.encode_scan(cloud, STAMP))
    points = np.frombuffer(message.data.tobytes(), encode.POINT)
    assert [field.name for field in message.fields] == list(encode.POINT.names)
    np.testing.assert_array_equal(points["z"], cloud.xyz_m[:, 2])
    assert np.abs(points["timestamp"] - STAMP - cloud.offset_ns).max() <= 256


def test_scan_of_non_contiguous_points_encodes_the_same():
    cloud = scan(20)
    strided = LidarScan(
        5,
        6,
        np.asfortranarray(cloud.xyz_m),
        np.repeat(cloud.reflectivity, 2)[::2],
        cloud.tag,
        cloud.line,
        cloud.offset_ns,
    )
    assert encode.encode_scan(strided, STAMP) == encode.encode_scan(cloud, STAMP)


@given(STAMPS, st.tuples(*[st.floats(width=64, allow_nan=False)] * 3), st.tuples(*[st.floats(allow_nan=False)] * 3))
@settings(max_examples=40)
def test_imu_equals_generic_encoder(stamp, gyro, accel):
    expected = oracle(
        schemas.IMU,
        record(
            header=header("base_link", stamp),
            orientation=vector((0.0, 0.0, 0.0, 1.0), "xyzw"),
            orientation_covariance=[-1.0, *[0.0] * 8],
            angular_velocity=vector(gyro),
            angular_velocity_covariance=UNKNOWN,
            linear_acceleration=vector(accel),
            linear_acceleration_covariance=UNKNOWN,
        ),
    )
    assert encode.encode_imu(ImuSample(1, 2, gyro, accel), stamp) == expected


def fix(quality, sigma=(0.5, 0.25, 1.0)):
    return GnssFix(1, 2, 3, False, quality, 47.1, 8.5, 512.25, 47.0, 12, 0.9, None, sigma, "gst")


@pytest.mark.parametrize(
    ("quality", "status"),
    [(FixQuality.INVALID, -1), (FixQuality.SINGLE, 0), (FixQuality.DGPS, 1), (FixQuality.RTK_FLOAT, 2)],
)
def test_fix_equals_generic_encoder(quality, status):
    known = quality is not FixQuality.INVALID
    covariance = [0.25, 0.0, 0.0, 0.0, 0.0625, 0.0, 0.0, 0.0, 1.0] if known else UNKNOWN
    expected = oracle(
        schemas.NAV_SAT_FIX,
        record(
            header=header("gnss_antenna"),
            status=record(status=status, service=15),
            latitude=47.1,
            longitude=8.5,
            altitude=512.25,
            position_covariance=covariance,
            position_covariance_type=2 if known else 0,
        ),
    )
    assert encode.encode_fix(fix(quality), STAMP) == expected


def test_fix_without_sigmas_says_covariance_unknown():
    message = rosbags_decoded(
        schemas.NAV_SAT_FIX, encode.encode_fix(fix(FixQuality.SINGLE, (math.nan, 1.0, 1.0)), STAMP)
    )
    assert message.position_covariance_type == 0
    assert not message.position_covariance.any()


@given(STAMPS, TEXT)
def test_sentence_equals_generic_encoder(stamp, text):
    expected = oracle(schemas.SENTENCE, record(header=header("gnss_antenna", stamp), sentence=text))
    assert encode.encode_sentence(NmeaSentence(1, 2, text), stamp) == expected


@given(st.binary(max_size=300))
def test_video_equals_generic_encoder(data):
    expected = oracle(
        schemas.COMPRESSED_VIDEO, record(timestamp=time_of(STAMP), frame_id="camera", data=data, format="h264")
    )
    assert encode.encode_video(VideoFrame(1, 2, data, True, 0), STAMP) == expected


@given(TEXT, st.sampled_from(list(Severity)))
def test_event_equals_generic_encoder(text, severity):
    level = {Severity.INFO: 20, Severity.WARNING: 30, Severity.ERROR: 40}[severity]
    expected = oracle(
        schemas.LOG,
        record(stamp=time_of(STAMP), level=level, name="livox", msg=text, file="", function="event", line=0),
    )
    assert encode.encode_event(SensorEvent(1, 2, "livox", severity, text), STAMP) == expected


def test_mark_says_who_and_what():
    message = rosbags_decoded(schemas.LOG, encode.encode_mark(Mark(1, 2, "Götterbaum"), STAMP))
    assert (message.name, message.function, message.msg) == ("operator", "mark", "Götterbaum")


@given(st.lists(st.tuples(st.sampled_from(list(Level)), TEXT, st.lists(st.tuples(TEXT, TEXT), max_size=3)), max_size=4))
@settings(max_examples=40)
def test_diagnostics_equal_generic_encoder(rows):
    statuses = tuple(DiagnosticStatus(name, level, name, "id", tuple(values)) for level, name, values in rows)
    expected = oracle(
        schemas.DIAGNOSTIC_ARRAY,
        record(
            header=header(""),
            status=[
                record(
                    level=int(status.level),
                    name=status.name,
                    message=status.message,
                    hardware_id="id",
                    values=[record(key=key, value=value) for key, value in status.values],
                )
                for status in statuses
            ],
        ),
    )
    assert encode.encode_diagnostics(Diagnostics(1, 2, statuses), STAMP) == expected


def test_transforms_equal_generic_encoder():
    transforms = (Transform("a", "b", (1, 2, 3)), Transform("base_link", "camera", (0, 0, 0), (0.5, -0.5, 0.5, -0.5)))
    expected = oracle(
        schemas.TF_MESSAGE,
        record(
            transforms=[
                record(
                    header=header(one.parent),
                    child_frame_id=one.child,
                    transform=record(translation=vector(one.translation_m), rotation=vector(one.rotation_xyzw, "xyzw")),
                )
                for one in transforms
            ]
        ),
    )
    assert encode.encode_transforms(transforms, STAMP) == expected


def test_strings_lose_their_nuls():
    message = rosbags_decoded(schemas.SENTENCE, encode.encode_sentence(NmeaSentence(1, 2, "a\x00b"), STAMP))
    assert message.sentence == "ab"
