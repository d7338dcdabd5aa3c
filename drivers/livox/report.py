"""The health of the LiDAR in one structure, worst news first."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

from drivers.driver import SensorHealth, SensorState, StreamHealth
from drivers.livox.hms import Level, worst
from drivers.livox.receive import Receiver
from drivers.livox.status import state_text
from drivers.livox.steward import Steward
from drivers.livox.stream import StreamDecoder

SCANS_HZ = 10.0
IMU_HZ = 200.0
FLOWING_S = 1.0
"""Data this recent count as flowing."""
STATUS_FRESH_S = 1.5
"""The LiDAR pushes its status every second."""


class Reporter:
    """Puts the parts of a running driver together; remembers what was already reported."""

    def __init__(self, name: str, receiver: Receiver, decoder: StreamDecoder, steward: Steward) -> None:
        self._name = name
        self._receiver = receiver
        self._decoder = decoder
        self._steward = steward
        self._lost = 0
        self._dropped = 0

    def health(self) -> SensorHealth:
        """Health since the last call."""
        now_ns = time.monotonic_ns()
        streams = self._streams(now_ns)
        lost, dropped = sum(stream.lost for stream in streams), self._receiver.kernel_drops
        findings = self._findings(now_ns, lost - self._lost, dropped - self._dropped)
        state, problem, advice = next(findings, (SensorState.OK, "", ""))
        self._lost, self._dropped = lost, dropped
        status = self._steward.status
        clock = self._decoder.clock_state
        if clock is not None and status is not None:
            clock = replace(clock, synchronised=status.time_source)
        return SensorHealth(
            self._name,
            state,
            streams,
            clock,
            problem,
            advice,
            temperature_c=status.temperature_c if status else None,
            details=self._details(),
        )

    def _streams(self, now_ns: int) -> tuple[StreamHealth, StreamHealth]:
        decoder = self._decoder
        scans_hz, _ = decoder.scan_meter.read(now_ns)
        _, points_gap_s = decoder.point_meter.read(now_ns)
        imu_hz, imu_gap_s = decoder.imu_meter.read(now_ns)
        points = decoder.points
        return (
            StreamHealth(
                "points",
                scans_hz,
                SCANS_HZ,
                decoder.scan_meter.total,
                points.lost,
                points_gap_s,
                units=points.received,
            ),
            StreamHealth("imu", imu_hz, IMU_HZ, decoder.imu_meter.total, decoder.imu.lost, imu_gap_s),
        )

    def _findings(self, now_ns: int, lost: int, dropped: int) -> Iterator[tuple[SensorState, str, str]]:
        """All that is wrong as state, problem and advice, the gravest first."""
        steward = self._steward
        points = _flows(self._decoder.point_meter.last_ns, now_ns)
        inertial = _flows(self._decoder.imu_meter.last_ns, now_ns)
        fault = worst(steward.status.hms) if steward.status else None
        if steward.state is SensorState.FAILED:
            yield SensorState.FAILED, steward.problem, steward.advice
        if fault and fault.level >= Level.FATAL:
            yield SensorState.FAILED, fault.text, fault.advice
        if not points and not inertial:
            yield self._silence(now_ns)
        if not points or not inertial:
            missing = "IMU data" if points else "points"
            yield SensorState.DEGRADED, f"no {missing}", "restart the LiDAR if this lasts"
        if steward.state is SensorState.SEARCHING:
            yield SensorState.DEGRADED, f"sends data, but: {steward.problem}", steward.advice
        if fault:
            yield SensorState.DEGRADED, fault.text, fault.advice
        if dropped > 0:
            yield SensorState.DEGRADED, f"{dropped} packets came too fast for this host", _BUFFER_ADVICE
        if lost > 0:
            yield SensorState.DEGRADED, f"{lost} packets lost since the last report", "check the Ethernet cable"

    def _silence(self, now_ns: int) -> tuple[SensorState, str, str]:
        """Why nothing comes: never reached, starting, or lost."""
        steward, last_ns = self._steward, self._decoder.point_meter.last_ns
        if steward.problem:
            return steward.state, steward.problem, steward.advice
        if last_ns is not None and steward.status_age_s() > STATUS_FRESH_S:
            return (
                SensorState.SEARCHING,
                f"silent for {(now_ns - last_ns) / 1e9:.0f} s",
                "check its power and the cable",
            )
        return steward.state, f"no data, the LiDAR is in state {self._work_state()}", ""

    def _work_state(self) -> str:
        status = self._steward.status
        return state_text(status.work_state if status else None)

    def _details(self) -> dict[str, str]:
        decoder, identity, status = self._decoder, self._steward.identity, self._steward.status
        details = {
            "address": self._steward.address,
            "work state": self._work_state(),
            "receive buffer (bytes)": str(self._receiver.buffer_bytes),
            "kernel drops": str(self._receiver.kernel_drops),
            "malformed packets": str(decoder.malformed),
            "odd packets": str(decoder.points.odd + decoder.imu.odd),
            "duplicate packets": str(decoder.points.duplicates + decoder.imu.duplicates),
            "late packets": str(decoder.points.late + decoder.imu.late),
            "packets later than their scan": str(decoder.too_late),
            "datagrams of others": str(self._receiver.foreign),
        }
        if identity:
            details |= {"serial number": identity.serial, "firmware": identity.firmware}
        if status:
            details["health codes"] = " ".join(f"{code:#010x}" for code in status.hms) or "none"
        return details


_BUFFER_ADVICE = "raise net.core.rmem_max to 8 MiB or more (the installer does), and check the load of this computer"


def _flows(last_ns: int | None, now_ns: int) -> bool:
    return last_ns is not None and now_ns - last_ns < FLOWING_S * 1e9
