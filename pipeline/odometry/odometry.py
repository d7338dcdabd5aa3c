"""LiDAR-inertial odometry: scans and inertial samples in, poses with covariance out.

odometry = LidarInertialOdometry(OdometryConfig())
odometry.offer_imu(sample)
odometry.offer_scan(scan)
for estimate in odometry.take():
    ...
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from drivers.messages import ImuSample, LidarScan
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.drift import Drift
from pipeline.odometry.errors import StartRefused
from pipeline.odometry.estimate import Odometry, Status
from pipeline.odometry.filter import Filter
from pipeline.odometry.footing import Footing
from pipeline.odometry.imu_buffer import ImuBuffer
from pipeline.odometry.initialise import force_scale, is_at_rest, start_at_rest, start_in_motion
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.state import GRAVITY, POSITION, gravity_axes
from pipeline.odometry.tracker import Registration, Tracker
from pipeline.odometry.upright import Upright

SWEEP_NS = 100_000_000
OVERLAP_NS = 20_000_000
"""A scan may begin this much before the one before it ended; what is older was passed by."""
WAIT_NS = 300_000_000
"""Scans wait so long for inertial samples up to their end, then go on with what there is."""
MOST_WAITING = 40


@dataclass(frozen=True, slots=True)
class Counts:
    """Since construction. late_imu: not used for being late, doubled or not finite; late_scans: for being too old."""

    scans: int = 0
    late_imu: int = 0
    late_scans: int = 0
    restarts: int = 0
    refusals: int = 0


class LidarInertialOdometry:
    """Deterministic for a given order of calls. Not thread-safe: one thread offers and takes."""

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._imu = ImuBuffer()
        self._waiting: deque[LidarScan] = deque()
        self._tracker: Tracker | None = None
        self._drift = Drift(config.drift)
        self._upright = Upright()
        self._force_scale = 1.0
        self._time_ns = 0
        self._footing = Footing()
        self._misfits = 0
        self._counts = Counts()
        self._note = ""

    @property
    def counts(self) -> Counts:
        """What went by and what was lost."""
        return replace(self._counts, late_imu=self._imu.late)

    @property
    def refusal(self) -> str:
        """Why there is no estimate yet, empty when there is."""
        return self._note if self._tracker is None else ""

    @property
    def map_voxels(self) -> int:
        """Voxels in use."""
        return len(self._tracker.map) if self._tracker else 0

    def offer_imu(self, sample: ImuSample) -> None:
        """Any order within what has not been used yet."""
        self._imu.add(sample)

    def offer_scan(self, scan: LidarScan) -> None:
        """Scans in any order; they are taken in order of time."""
        at = len(self._waiting)
        while at > 0 and self._waiting[at - 1].stamp_ns > scan.stamp_ns:
            at -= 1
        self._waiting.insert(at, scan)

    def take(self, *, flush: bool = False) -> Iterator[Odometry]:
        """Estimates of all scans whose inertial samples have come. flush: of all scans, come what may."""
        while self._waiting and (flush or self._ready()):
            if self._tracker is None and not self._start(flush=flush):
                return
            if estimate := self.process_scan(self._waiting.popleft()):
                yield estimate

    def process_scan(self, scan: LidarScan) -> Odometry | None:
        """One scan, after a start and in order; None for one that is too old."""
        tracker = self._tracker
        if tracker is None or scan.stamp_ns < self._time_ns - OVERLAP_NS:
            self._counts = replace(self._counts, late_scans=self._counts.late_scans + 1)
            return None
        end_ns = max(_end_ns(scan), self._time_ns + 1)
        imu = self._samples(self._time_ns, end_ns, scan.stamp_ns)
        gap_s = self._imu.gap_s(self._time_ns, end_ns)
        before = tracker.filter.state
        found = tracker.track(scan, imu)
        self._imu.taken(end_ns)
        self._time_ns = end_ns
        self._counts = replace(self._counts, scans=self._counts.scans + 1)
        self._upright.follow(tracker.filter.state)
        step_m = self._upright.turn @ (tracker.filter.state.position_m - before.position_m)
        self._drift.move(step_m, self._drift_factor(found))
        estimate = self._estimate(end_ns, found, gap_s=gap_s, saturated=self._saturated(imu))
        if reason := self._broken(found, gap_s):
            self._break(reason, gap_s)
        return estimate

    def _ready(self) -> bool:
        end_ns = _end_ns(self._waiting[0])
        newest_ns = max(self._imu.newest_ns, self._waiting[-1].stamp_ns - WAIT_NS)
        return newest_ns >= end_ns or len(self._waiting) > MOST_WAITING

    def _samples(self, begin_ns: int, end_ns: int, zero_ns: int) -> Doubles:
        rows = self._imu.between(begin_ns, end_ns, zero_ns)
        rows[:, 4:7] *= self._force_scale
        return rows

    def _start(self, *, flush: bool) -> bool:
        """Find a first state for the scans that wait; False while more data is needed."""
        while self._waiting and (flush or self._ready()):
            first = self._waiting[0]
            try:
                started = self._first_state(first)
            except StartRefused as refused:
                self._counts = replace(self._counts, refusals=self._counts.refusals + 1)
                self._note = str(refused)
                self._waiting.popleft()
                continue
            if started is None:
                if flush:
                    self._waiting.popleft()
                    continue
                return False
            self._tracker = Tracker(self._config, self._footing.place(started, first.stamp_ns))
            self._time_ns = first.stamp_ns
            return True
        return False

    def _first_state(self, first: LidarScan) -> Filter | None:
        """At the start of a scan; None while more data is needed. StartRefused with what is missing."""
        window_ns = int(self._config.start.window_s * 1e9)
        if self._imu.gap_s(first.stamp_ns, _end_ns(first)) > 2.0 * self._config.imu.longest_step_s:
            raise StartRefused("no inertial samples with this scan")
        windows = [(first.stamp_ns - window_ns, first.stamp_ns), (first.stamp_ns, first.stamp_ns + window_ns)]
        whole = [(a, b) for a, b in windows if self._imu.covers(a, b, self._config.imu.longest_step_s)]
        for begin_ns, end_ns in whole:
            imu = self._imu.window(begin_ns, end_ns)
            self._force_scale = force_scale(imu)
            imu[:, 4:7] *= self._force_scale
            if is_at_rest(imu, self._config):
                return start_at_rest(imu, self._config)
        self._note = "in motion: a second of scans and inertial samples is needed to begin"
        count = self._config.start.moving_scans
        if not whole or len(self._waiting) < count or self._imu.newest_ns < _end_ns(self._waiting[count - 1]):
            late = self._imu.newest_ns > first.stamp_ns + 2 * window_ns
            if late and not whole:
                raise StartRefused("the inertial samples with this scan have holes")
            return None
        return self._moving([self._waiting[k] for k in range(count)])

    def _moving(self, scans: list[LidarScan]) -> Filter:
        begins = [scans[0].stamp_ns, *(_end_ns(scan) for scan in scans[:-1])]
        windows = [self._samples(b, _end_ns(s), s.stamp_ns) for b, s in zip(begins, scans, strict=True)]
        return start_in_motion(scans, windows, self._config)

    def _drift_factor(self, found: Registration) -> float:
        seen = found.observability
        return 3.0 if seen is None or seen.degenerate else 1.0

    def _saturated(self, imu: Doubles) -> bool:
        limits = self._config.imu
        rate, force = np.abs(imu[:, 1:4]).max(), np.abs(imu[:, 4:7]).max()
        return bool(rate > 0.99 * limits.gyro_range_rad_s or force > 0.99 * limits.accel_range_m_s2)

    def _broken(self, found: Registration, gap_s: float) -> str:
        """Why the state is not worth going on from; empty when it is."""
        assert self._tracker is not None
        fault, residuals = self._config.fault, found.residuals
        fits = residuals.matches >= self._config.match.least_share * max(residuals.clusters, 1)
        self._misfits = 0 if fits or residuals.clusters == 0 else self._misfits + 1
        spread = np.sqrt(np.diag(self._tracker.filter.covariance)[POSITION].max())
        speed = np.linalg.norm(self._tracker.filter.state.velocity_m_s)
        if gap_s > fault.imu_gap_s:
            return f"no inertial samples for {gap_s:.2f} s"
        if self._misfits > fault.misfits:
            return f"{self._misfits} scans in a row do not fit the map"
        if spread > fault.lost_m or not np.isfinite(spread):
            return f"position within the map is uncertain by {spread:.1f} m"
        if speed > fault.fastest_m_s:
            return f"speed of {speed:.0f} m/s"
        return ""

    def _break(self, reason: str, gap_s: float) -> None:
        """Give the state up: the next scans start again from this pose, with a new map and an honest covariance."""
        assert self._tracker is not None
        state, covariance = self._tracker.filter.state, self._tracker.filter.covariance
        speed = min(float(np.linalg.norm(state.velocity_m_s)), self._config.fault.fastest_m_s)
        known = float(np.sqrt(max(np.trace(covariance[POSITION, POSITION]), 0.0)))
        known = min(known, 1e3) if np.isfinite(known) else 1e3
        self._drift.widen(known + (speed + 1.0) * max(gap_s, 0.5), 0.3 + 0.5 * min(gap_s, 5.0))
        self._footing = Footing(state, self._time_ns, f"restarted: {reason}")
        self._tracker, self._misfits, self._note = None, 0, f"restarting: {reason}"
        self._counts = replace(self._counts, restarts=self._counts.restarts + 1)

    def _estimate(self, stamp_ns: int, found: Registration, *, gap_s: float, saturated: bool) -> Odometry:
        assert self._tracker is not None
        state, covariance = self._tracker.filter.state, self._tracker.filter.covariance
        turn = self._upright.turn
        rotation = turn @ state.rotation
        spin = np.eye(9)
        spin[3:6, 3:6] = spin[6:9, 6:9] = turn
        whole = spin @ covariance[:9, :9] @ spin.T
        in_map = whole[:6, :6].copy()
        tilt = state.rotation.T @ gravity_axes(state.gravity_m_s2)
        whole[:3, :3] += tilt @ covariance[GRAVITY, GRAVITY] @ tilt.T
        whole[:6, :6] = self._drift.add_to(whole[:6, :6], rotation)
        seen, note = found.observability, self._footing.say()
        nothing = np.empty((0, 3))
        return Odometry(
            stamp_ns,
            Status.RESTARTED if note else self._status(found),
            rotation,
            self._upright.position(state),
            turn @ state.velocity_m_s,
            state.gyro_bias,
            state.accel_bias,
            whole,
            in_map,
            seen.weak_attitude if seen else nothing,
            seen.weak_position @ turn.T if seen else nothing,
            found.residuals,
            found.cloud,
            saturated,
            gap_s if gap_s > self._config.imu.longest_step_s else 0.0,
            note,
        )

    def _status(self, found: Registration) -> Status:
        residuals = found.residuals
        if residuals.clusters > 0 and residuals.iterations == 0:
            return Status.TRACKING  # the first scan is the map
        if residuals.matches < self._config.match.least_share * max(residuals.clusters, 1):
            return Status.COASTING
        degenerate = found.observability is not None and found.observability.degenerate
        return Status.DEGENERATE if degenerate else Status.TRACKING


def _end_ns(scan: LidarScan) -> int:
    return scan.stamp_ns + (int(scan.offset_ns.max()) if len(scan.offset_ns) else SWEEP_NS)
