"""What encoding to CDR costs: the recorded messages decoded again, and encoded as the writer's thread does."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.recording.writers import Recorded
from drivers.messages import FixQuality, GnssFix, ImuSample, LidarScan, NmeaSentence, VideoFrame
from edge.ros import decode
from edge.ros.encode import ENCODERS


def encode_cores(recorded: Sequence[Recorded], runs: int = 3) -> dict[str, float]:
    """CPU seconds per recorded second by topic, best of `runs`."""
    seconds = (recorded[-1].log_ns - recorded[0].log_ns) / 1e9
    cores = {}
    for topic, back in _BACK.items():
        made = [back(one) for one in recorded if one.topic == topic]
        if not made:
            continue
        encoder = ENCODERS[type(made[0])]
        cores[topic] = min(_time(encoder, made) for _ in range(runs)) / seconds
    return cores


def _time(encoder: Callable[[object, int], bytes], made: Sequence[object]) -> float:
    start_s = time.thread_time()
    for one in made:
        encoder(one, 1_700_000_000_000_000_000)
    return time.thread_time() - start_s


def _scan(one: Recorded) -> LidarScan:
    points = decode.decode_point_cloud(one.data).points
    xyz_m = np.stack([points["x"], points["y"], points["z"]], axis=1)
    offset_ns = (points["timestamp"] - points["timestamp"][0]).astype(np.uint32)
    level = points["intensity"].astype(np.uint8)
    return LidarScan(one.publish_ns, one.log_ns, xyz_m, level, points["tag"].copy(), points["line"].copy(), offset_ns)


def _sample(one: Recorded) -> ImuSample:
    imu = decode.decode_imu(one.data)
    return ImuSample(one.publish_ns, one.log_ns, imu.angular_velocity[:3], imu.linear_acceleration[:3])  # type: ignore[arg-type]


def _fix(one: Recorded) -> GnssFix:
    fix = decode.decode_fix(one.data)
    position = (fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
    stamps = (one.publish_ns, one.log_ns, one.publish_ns, False)
    return GnssFix(*stamps, FixQuality.RTK_FLOAT, *position, 44.0, 14, 0.9, 1.0, (0.2, 0.2, 0.4), "gst")


def _sentence(one: Recorded) -> NmeaSentence:
    return NmeaSentence(one.publish_ns, one.log_ns, decode.decode_sentence(one.data).sentence)


def _frame(one: Recorded) -> VideoFrame:
    return VideoFrame(one.publish_ns, one.log_ns, bytes(decode.decode_video(one.data).data), False, 0)


_BACK: dict[str, Callable[[Recorded], object]] = {
    "/livox/lidar": _scan,
    "/livox/imu": _sample,
    "/gnss/fix": _fix,
    "/gnss/nmea": _sentence,
    "/camera/video": _frame,
}
