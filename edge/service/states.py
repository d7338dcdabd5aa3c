"""Drivers' words as the clients of the control socket get them."""

from __future__ import annotations

import math

from drivers.clock import ClockState
from drivers.driver import SensorHealth
from drivers.messages import QUALITY_NAMES, GnssFix
from edge.control.messages import Clock, Gnss, Sensor, Stream


def sensor_state(health: SensorHealth) -> Sensor:
    """One sensor."""
    return Sensor(
        name=health.name,
        state=health.state.value,
        streams=tuple(
            Stream(one.name, _finite(one.rate_hz), one.expected_hz, one.received, one.lost, _finite(one.largest_gap_s))
            for one in health.streams
        ),
        clock=_clock(health.clock) if health.clock else None,
        problem=health.problem,
        advice=health.advice,
        temperature_c=health.temperature_c,
        battery_percent=health.battery_percent,
        details=dict(health.details),
    )


def gnss_state(fix: GnssFix, now_ns: int) -> Gnss:
    """The last fix in brief. Sigmas are 0 where there is no fix."""
    east, north, up = fix.sigma_enu_m
    return Gnss(
        quality=int(fix.quality),
        quality_name=QUALITY_NAMES[fix.quality],
        satellites=fix.satellites,
        sigma_horizontal_m=_finite(math.hypot(east, north)),
        sigma_vertical_m=_finite(up),
        age_s=max(0.0, (now_ns - fix.receive_ns) / 1e9),
    )


def _clock(clock: ClockState) -> Clock:
    return Clock(
        sigma_ms=_finite(clock.sigma_ns / 1e6),
        skew_ppm=_finite(clock.skew_ppm),
        jitter_ms=_finite(clock.jitter_ns / 1e6),
        steps=clock.steps,
        synchronised=clock.synchronised,
    )


def _finite(value: float) -> float:
    """JSON has neither NaN nor infinity."""
    return value if math.isfinite(value) else 0.0
