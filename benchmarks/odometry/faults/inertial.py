"""What can be wrong with the inertial samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.odometry.faults.streams import Fault, Span, Streams, each_sample
from drivers.messages import ImuSample
from drivers.sim.imu import GRAVITY_M_S2

Vector = tuple[float, float, float]


def saturated(gyro_rad_s: float, accel_m_s2: float) -> Fault:
    """Readings end at a range."""

    def clip(sample: ImuSample) -> ImuSample:
        return _with(
            sample,
            np.clip(sample.angular_velocity, -gyro_rad_s, gyro_rad_s),
            np.clip(sample.linear_acceleration, -accel_m_s2, accel_m_s2),
        )

    return lambda streams, span: each_sample(streams, span, clip)


def biased(gyro_rad_s: Vector = (0.0, 0.0, 0.0), accel_m_s2: Vector = (0.0, 0.0, 0.0)) -> Fault:
    """A bias jumps, and stays so for the span."""

    def jump(sample: ImuSample) -> ImuSample:
        return _with(
            sample, np.add(sample.angular_velocity, gyro_rad_s), np.add(sample.linear_acceleration, accel_m_s2)
        )

    return lambda streams, span: each_sample(streams, span, jump)


def in_g(streams: Streams, span: Span) -> Streams:
    """The accelerometer as the Mid-360 itself gives it, unconverted."""

    def scaled(sample: ImuSample) -> ImuSample:
        return _with(sample, np.array(sample.angular_velocity), np.divide(sample.linear_acceleration, GRAVITY_M_S2))

    return each_sample(streams, span, scaled)


def lost_samples(share: float) -> Fault:
    """Single samples never arrive; all of the span for 1."""

    def apply(streams: Streams, span: Span) -> Streams:
        random = np.random.default_rng(21)
        kept = [sample for sample in streams.imu if not span.holds(sample) or random.random() >= share]
        return replace(streams, imu=tuple(kept))

    return apply


def _with(sample: ImuSample, rate: np.ndarray, force: np.ndarray) -> ImuSample:
    (wx, wy, wz), (fx, fy, fz) = rate.tolist(), force.tolist()
    return replace(sample, angular_velocity=(wx, wy, wz), linear_acceleration=(fx, fy, fz))
