"""Any recording with a LiDAR and an IMU comes out as the drivers' messages."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.messages import FixQuality, GnssFix, ImuSample, LidarScan
from edge.config import Config
from edge.errors import FormatError
from edge.recording.anchor import Anchor
from edge.recording.session import SessionAbout, SessionRecorder
from edge.replay.replay import Replay, ReplayOptions
from edge.replay.topics import Wanted
from tests.edge.recording import recording_scene as scene
from tests.edge.replay import foreign
from tests.edge.replay.foreign import START_NS, SWEEP_NS, offsets_ns, walk


def of(messages, kind):
    return [message for message in messages if isinstance(message, kind)]


def replay(path, **kwargs):
    return Replay([path], Config(), ReplayOptions(**kwargs))


TIMES = {
    "absolute ns": ("timestamp", "f8", lambda stamp: (stamp + offsets_ns()).astype(float)),
    "absolute s": ("timestamp", "f8", lambda stamp: (stamp + offsets_ns()) / 1e9),
    "relative ns": ("t", "u4", lambda _: offsets_ns()),
    "relative us": ("offset_time", "u4", lambda _: offsets_ns() // 1000),
    "relative ms": ("time", "f4", lambda _: offsets_ns() / 1e6),
    "relative s": ("time", "f4", lambda _: offsets_ns() / 1e9),
    "own clock, s": ("timestamp", "f8", lambda stamp: (stamp + offsets_ns()) / 1e9 - 1.7e9),
    "own clock, ns": (
        "Timestamp",
        "f8",
        lambda stamp: (stamp + offsets_ns() - START_NS + 50_000_000_000).astype(float),
    ),
}


@pytest.mark.parametrize("name", TIMES)
def test_point_times_in_every_unit_and_origin_come_out_the_same(name, tmp_path):
    field, code, values = TIMES[name]
    bag = walk(lambda stamp: foreign.plain(stamp, (field, code, values(stamp))))
    scans = of(replay(bag.write(tmp_path / "a.mcap")).messages(), LidarScan)
    assert len(scans) == 6
    for k, scan in enumerate(scans):
        assert abs(scan.stamp_ns - (START_NS + k * SWEEP_NS)) < 1000
        assert np.abs(scan.offset_ns.astype(np.int64) - offsets_ns()).max() < 5000
        np.testing.assert_array_equal(scan.xyz_m, foreign.xyz())
        assert scan.reflectivity[-1] == 250


def test_times_counted_back_from_the_end_of_the_sweep(tmp_path):
    bag = walk(lambda stamp: foreign.plain(stamp + SWEEP_NS, ("time", "f4", (offsets_ns() - SWEEP_NS) / 1e9)))
    scans = of(replay(bag.write(tmp_path / "a.mcap")).messages(), LidarScan)
    assert abs(scans[2].stamp_ns - (START_NS + 2 * SWEEP_NS)) < 20_000


def test_custom_messages_of_livox(tmp_path):
    scans = of(replay(walk(foreign.custom).write(tmp_path / "a.mcap")).messages(), LidarScan)
    assert len(scans) == 6
    np.testing.assert_array_equal(scans[1].xyz_m, foreign.xyz())
    np.testing.assert_array_equal(scans[1].offset_ns, offsets_ns())
    assert (scans[1].stamp_ns, scans[1].tag[0], scans[1].line[0]) == (START_NS + SWEEP_NS, 16, 3)


@pytest.mark.parametrize(("acceleration", "unit"), [(1.0, "IMU /imu in g"), (9.79, "IMU /imu in m/s^2")])
def test_acceleration_is_in_si_units_whatever_was_written(acceleration, unit, tmp_path):
    found = replay(walk(foreign.custom, acceleration=acceleration).write(tmp_path / "a.mcap"))
    samples = of(found.messages(), ImuSample)
    assert unit in found.notes
    assert len(samples) == 120
    assert samples[0].linear_acceleration[2] == pytest.approx(acceleration * (9.80665 if acceleration < 2 else 1.0))
    assert samples[0].angular_velocity == (0.01, -0.02, 0.03)


def test_no_returns_are_left_out_of_organised_clouds(tmp_path):
    def organised(stamp):
        points = foreign.xyz()
        points[::4] = 0.0
        points[1::8] = np.nan
        fields = {name: ("f4", values) for name, values in zip("xyz", points.T, strict=True)}
        times = np.where(np.arange(len(points)) % 4 == 0, 0, offsets_ns())
        extra = {
            "t": ("u4", times),
            "reflectivity": ("u2", np.full(len(points), 60_000)),
            "ring": ("u2", np.zeros(len(points))),
        }
        return foreign.cloud(stamp, {**fields, **extra}, height=8)

    scan = of(replay(walk(organised).write(tmp_path / "a.mcap")).messages(), LidarScan)[0]
    assert len(scan.xyz_m) == foreign.POINTS - foreign.POINTS // 4 - foreign.POINTS // 8
    assert np.isfinite(scan.xyz_m).all()
    assert scan.reflectivity.max() == 255


def test_messages_come_in_order_of_time_however_they_lie_in_the_file(tmp_path):
    bag = walk(foreign.custom)
    bag.messages.reverse()
    files = [bag.write(tmp_path / "reversed.mcap", chunk_size=2000)]
    for chunked in (True, False):
        files.append(walk(foreign.custom).write(tmp_path / f"{chunked}.mcap", chunked=chunked))
    read = [[(type(m), m.stamp_ns, m.receive_ns) for m in replay(path).messages()] for path in files]
    assert read[0] == read[1] == read[2]
    assert len(read[0]) == 126
    arrivals = [receive_ns for _, _, receive_ns in read[0]]
    assert arrivals == sorted(arrivals)


def test_fixes_have_quality_and_sigma(tmp_path):
    bag = walk(foreign.custom)
    for k, (status, sigma_m) in enumerate([(-1, 1.0), (0, 3.0), (1, 0.6), (2, 0.3), (2, 0.015)]):
        bag.add("/gps/fix", START_NS + k * SWEEP_NS, foreign.fix(START_NS + k * SWEEP_NS, status, sigma_m))
    fixes = of(replay(bag.write(tmp_path / "a.mcap")).messages(), GnssFix)
    expected = [FixQuality.INVALID, FixQuality.SINGLE, FixQuality.DGPS, FixQuality.RTK_FLOAT, FixQuality.RTK_FIXED]
    assert [fix.quality for fix in fixes] == expected
    assert fixes[1].sigma_enu_m == pytest.approx((3.0, 3.0, 6.0))
    assert not of(replay(tmp_path / "a.mcap").messages(gnss=False), GnssFix)


def test_the_pose_of_a_foreign_lidar_comes_from_its_static_transforms(tmp_path):
    bag = walk(lambda stamp: foreign.plain(stamp, ("t", "u4", offsets_ns())))
    bag.add("/tf_static", START_NS, foreign.transform("base", "lidar", 1.0))
    bag.add("/tf_static", START_NS, foreign.transform("base", "imu", 0.25, np.pi / 4))
    found = replay(bag.write(tmp_path / "a.mcap"))
    np.testing.assert_allclose(found.geometry.lidar[:3, 3], [0.0, -0.75, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.geometry.lidar[:3, 0], [0.0, -1.0, 0.0], atol=1e-12)
    assert not found.geometry.notes


def test_an_unknown_pose_is_said(tmp_path):
    bag = walk(lambda stamp: foreign.plain(stamp, ("t", "u4", offsets_ns())))
    assert "--lidar-pose" in replay(bag.write(tmp_path / "a.mcap")).geometry.notes[0]


def test_topics_are_found_by_type_and_can_be_named(tmp_path):
    bag = walk(foreign.custom, lidar="/front/livox/lidar", imu_topic="/front/livox/imu")
    for k in range(200):
        bag.add("/car/imu", START_NS + k, foreign.imu(START_NS + k * 1_000_000, 9.8))
    bag.add("/map_cloud", START_NS, foreign.plain(START_NS))
    path = bag.write(tmp_path / "a.mcap")
    assert (replay(path).topics.lidar, replay(path).topics.imu) == ("/front/livox/lidar", "/front/livox/imu")
    assert replay(path, wanted=Wanted(imu="/car/imu")).topics.imu == "/car/imu"
    with pytest.raises(FormatError, match="'/gone' is not in this recording; inertial data are on /car/imu, /front"):
        replay(path, wanted=Wanted(imu="/gone"))


def refused(bag, tmp_path):
    with pytest.raises(FormatError) as caught:
        replay(bag.write(tmp_path / "a.mcap"))
    return str(caught.value)


def test_what_cannot_be_used_is_said_with_what_to_do(tmp_path):
    said = refused(walk(foreign.plain), tmp_path)
    assert "no time of their own (fields x, y, z, intensity" in said
    assert "record again" in said
    said = refused(walk(lambda stamp: foreign.plain(stamp, ("t", "u4", 0 * offsets_ns()))), tmp_path)
    assert "have the same 't'" in said
    said = refused(walk(lambda stamp: foreign.plain(stamp, ("t", "f4", offsets_ns() * 20.0 / 1e9))), tmp_path)
    assert "--time-field" in said
    said = refused(walk(foreign.custom, acceleration=0.0), tmp_path)
    assert "gravity neither in m/s^2" in said
    bag = walk(foreign.custom)
    bag.messages = [message for message in bag.messages if message[0] != "/imu"]
    assert "no IMU in this recording" in refused(bag, tmp_path)
    assert "no LiDAR in this recording" in refused(foreign.Bag([("/imu", 1, foreign.imu(1, 9.8))]), tmp_path)
    bag = walk(lambda stamp: foreign.custom(stamp - 1_000_000 * 10**9))
    assert "different clocks" in refused(bag, tmp_path)


def test_our_own_sessions_of_several_splits(tmp_path):
    clock = scene.FakeClock(10 * scene.S)
    config = scene.limits(folder=str(tmp_path), split_s=1.0)
    about, anchor = SessionAbout(mission="m"), Anchor(scene.UTC_NS, 10 * scene.S)
    session = SessionRecorder(tmp_path / "s", about, config, anchor, disk=scene.FaultyDisk(), clock=clock)
    session.start()
    octets = np.full((3, foreign.POINTS), 9, np.uint8)
    offered = [m for k in range(3) for m in scene.second(10 * scene.S + k * scene.S)]
    offered = [
        LidarScan(m.stamp_ns, m.receive_ns, foreign.xyz(), *octets, offsets_ns().astype(np.uint32))
        if isinstance(m, LidarScan)
        else m
        for m in offered
    ]
    for message in offered:
        session.offer(message)
    session.stop("end")
    found = Replay([tmp_path / "s"], Config())
    messages = list(found.messages())
    assert len(found.files) >= 3
    assert [len(of(messages, kind)) for kind in (LidarScan, ImuSample, GnssFix)] == [30, 600, 30]
    scan = of(messages, LidarScan)[7]
    assert scan.stamp_ns == scene.UTC_NS + 700 * scene.MS
    np.testing.assert_array_equal(scan.xyz_m, foreign.xyz())
    assert np.abs(scan.offset_ns.astype(int) - offsets_ns()).max() < 512
    assert (scan.reflectivity[0], scan.tag[0], scan.line[0]) == (9, 9, 9)
    assert of(messages, GnssFix)[0].sigma_enu_m == (1.0, 1.0, 1.0)
