"""LiDAR-inertial odometry: scans and inertial samples in, poses with covariance out.

odometry = LidarInertialOdometry(OdometryConfig())
odometry.offer_imu(sample)
odometry.offer_scan(scan)
for estimate in odometry.take():
    ...
"""

from __future__ import annotations

import bisect
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from drivers.messages import ImuSample, LidarScan
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.drift import Drift
from pipeline.odometry.errors import StartRefused
from pipeline.odometry.estimate import Odometry, Status
from pipeline.odometry.fit import Fit
from pipeline.odometry.footing import Footing
from pipeline.odometry.imu_buffer import ImuBuffer
from pipeline.odometry.published import published
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.start import Starter, end_ns
from pipeline.odometry.state import GRAVITY, POSITION, State
from pipeline.odometry.time_gate import TimeGate
from pipeline.odometry.tracker import Tracker
from pipeline.odometry.upright import Upright
from pipeline.odometry.watch import Watch

OVERLAP_NS = 20_000_000
"""A scan may begin this much before the one before it ended; what is older was passed by."""
WAIT_NS = 300_000_000
"""Scans wait so long for inertial samples up to their end, then go on with what there is."""
MOST_WAITING = 40
MOST_BEHIND = 10
"""So many scans in a row from before the last one used are no disorder: the stamps went back."""
TOLD_SILENCE_NS = 400_000_000
NO_GOOD = 3.0
"""By how much faster the map drifts where a scan was no good."""
WORDS = {
    Status.DEGENERATE: "the scan leaves a direction open: along it the inertial samples lead",
    Status.DOUBTFUL: "scan and inertial samples contradict each other",
    Status.COASTING: "the scan does not fit the map: carried by the inertial samples alone",
}


@dataclass(frozen=True, slots=True)
class Counts:
    """Since construction. late_imu: not used for being late, doubled or not finite; late_scans: for being too old.

    leapt: messages left out for stamps that nothing bore out.
    """

    scans: int = 0
    late_imu: int = 0
    late_scans: int = 0
    leapt: int = 0
    restarts: int = 0
    refusals: int = 0


class LidarInertialOdometry:
    """Deterministic for a given order of calls. Not thread-safe: one thread offers and takes."""

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._imu_gate, self._scan_gate = TimeGate[ImuSample](), TimeGate[LidarScan]()
        self._imu = ImuBuffer()
        self._waiting: list[LidarScan] = []
        self._starter = Starter(config)
        self._tracker: Tracker | None = None
        self._watch = Watch(config)
        self._drift = Drift(config.drift)
        self._upright = Upright()
        self._footing = Footing()
        self._time_ns = 0
        self._behind, self._went_back_s = 0, 0.0
        self._counts = Counts()
        self._note = self._refused = ""

    @property
    def counts(self) -> Counts:
        """What went by and what was lost."""
        return replace(self._counts, late_imu=self._imu.late, leapt=self._imu_gate.refused + self._scan_gate.refused)

    @property
    def refusal(self) -> str:
        """Why there is no estimate now, empty when there is."""
        return self._note if self._tracker is None else ""

    @property
    def map_voxels(self) -> int:
        """Voxels in use."""
        return len(self._tracker.map) if self._tracker else 0

    def offer_imu(self, sample: ImuSample) -> None:
        """Any order within what has not been used yet."""
        admitted = self._imu_gate.admit(sample, self._scan_gate.newest_ns)
        if self._imu_gate.leapt_ns < 0:  # what had been offered is of another time
            self._imu.clear()
        for one in admitted:
            self._imu.add(one)

    def offer_scan(self, scan: LidarScan) -> None:
        """Scans in any order; they are taken in order of time."""
        admitted = self._scan_gate.admit(scan, self._imu_gate.newest_ns)
        if self._scan_gate.leapt_ns < 0:
            self._waiting.clear()
        for one in admitted:
            bisect.insort(self._waiting, one, key=_stamp)

    def take(self, *, flush: bool = False) -> Iterator[Odometry]:
        """Estimates of all scans whose inertial samples have come. flush: of all scans, come what may."""
        while self._waiting and (flush or self._ready()):
            if self._passed_by(self._waiting[0]):
                self._waiting.pop(0)
            elif self._tracker is None and not self._start(flush=flush):
                return
            elif estimate := self.process_scan(self._waiting[0]):
                self._waiting.pop(0)
                yield estimate

    def process_scan(self, scan: LidarScan) -> Odometry | None:
        """One scan, after a start and in order; None when it ended up astray: it is one to start anew with."""
        tracker = self._tracker
        assert tracker is not None
        silent_ns, stop_ns = scan.stamp_ns - self._time_ns, max(end_ns(scan), self._time_ns + 1)
        imu = self._imu.between(self._time_ns, stop_ns, scan.stamp_ns)
        imu[:, 4:7] *= self._starter.force_scale
        gap_s = self._imu.gap_s(self._time_ns, stop_ns)
        before, covariance = tracker.filter.state, tracker.filter.covariance
        found = tracker.track(scan, imu)
        if gap_s > self._config.fault.imu_gap_s and found.fit is not Fit.GOOD:
            self._break(f"neither scans nor inertial samples for {gap_s:.1f} s", before, covariance)
            return None
        self._imu.taken(stop_ns)
        self._time_ns = stop_ns
        self._counts = replace(self._counts, scans=self._counts.scans + 1)
        status = self._watch.follow(found, gap_s)
        self._upright.follow(tracker.filter.state)
        step_m = self._upright.turn @ (tracker.filter.state.position_m - before.position_m)
        gap_s = gap_s if gap_s > self._config.imu.longest_step_s else 0.0
        saturated, restarted = self._saturated(imu), self._footing.say()
        good = status is Status.TRACKING and not (saturated or gap_s)
        tilt = 0.5 * float(np.trace(tracker.filter.covariance[GRAVITY, GRAVITY]))
        self._drift.move(step_m, 1.0 if good else NO_GOOD, found.leaning @ self._upright.turn.T, tilt)
        estimate = published(
            stop_ns,
            Status.RESTARTED if restarted else status,
            tracker.filter,
            found,
            upright=self._upright,
            drift=self._drift,
            saturated=saturated,
            gap_s=gap_s,
            note="; ".join(word for word in (restarted, *self._words(status, silent_ns, gap_s, saturated)) if word),
        )
        if reason := self._watch.broken(tracker.filter):
            self._break(reason, tracker.filter.state, tracker.filter.covariance)
        return estimate

    def _ready(self) -> bool:
        end = end_ns(self._waiting[0])
        newest_ns = max(self._imu.newest_ns, self._waiting[-1].stamp_ns - WAIT_NS)
        return newest_ns >= end or len(self._waiting) > MOST_WAITING

    def _passed_by(self, scan: LidarScan) -> bool:
        """Whether a scan is from before the last one used; after many of them the state is given up."""
        behind_ns = self._time_ns - scan.stamp_ns
        if behind_ns <= OVERLAP_NS:
            self._behind, self._went_back_s = 0, 0.0
            return False
        self._behind += 1
        self._went_back_s = max(self._went_back_s, behind_ns * 1e-9)
        self._counts = replace(self._counts, late_scans=self._counts.late_scans + 1)
        if self._behind == MOST_BEHIND:
            reason = f"the stamps went back by {self._went_back_s:.1f} s"
            self._waiting[:] = [scan]  # the others are of before
            if self._tracker is not None:
                self._imu.clear()
                self._break(reason, self._tracker.filter.state, self._tracker.filter.covariance, self._went_back_s)
            self._note = f"{reason}: nothing is estimated until they are where they were"
        return True

    def _start(self, *, flush: bool) -> bool:
        """Find a first state for the scans that wait; False while more data is needed."""
        while self._waiting and (flush or self._ready()):
            first = self._waiting[0]
            try:
                started = self._starter.first_state(self._waiting, self._imu)
            except StartRefused as refused:
                self._counts = replace(self._counts, refusals=self._counts.refusals + 1)
                self._note = self._refused = str(refused)
                del self._waiting[: refused.scans]
                continue
            if started is not None:
                self._drift.widen(*self._footing.doubt(first.stamp_ns))
                self._tracker = Tracker(self._config, self._footing.place(started, first.stamp_ns))
                self._time_ns, self._refused = first.stamp_ns, ""
                return True
            self._note = self._refused or self._starter.awaits
            if not flush:
                return False
            self._waiting.pop(0)
        return False

    def _break(self, reason: str, state: State, covariance: Doubles, lost_s: float = 0.0) -> None:
        """Give the state up: the next scans start again from this pose, with a new map and an honest covariance."""
        known_m = float(np.sqrt(np.maximum(np.trace(covariance[POSITION, POSITION]), 0.0)))
        self._footing = Footing(state, self._time_ns, f"restarted: {reason}", known_m, lost_s)
        self._tracker, self._watch, self._note = None, Watch(self._config), f"restarting: {reason}"
        self._counts = replace(self._counts, restarts=self._counts.restarts + 1)

    def _saturated(self, imu: Doubles) -> bool:
        limits = self._config.imu
        rate, force = np.abs(imu[:, 1:4]).max(), np.abs(imu[:, 4:7]).max()
        return bool(rate > 0.99 * limits.gyro_range_rad_s or force > 0.99 * limits.accel_range_m_s2)

    def _words(self, status: Status, silent_ns: int, gap_s: float, saturated: bool) -> tuple[str, ...]:
        """For the operator, empty where nothing happened."""
        leapt = self._imu_gate.newly_refused() + self._scan_gate.newly_refused()
        return (
            WORDS.get(status, ""),
            "check the LiDAR's mounting, calibration and clock" if self._watch.contradicted else "",
            f"no points for {silent_ns * 1e-9:.1f} s" if silent_ns > TOLD_SILENCE_NS else "",
            "no inertial samples for a while" if gap_s else "",
            "the inertial sensor reached its range" if saturated else "",
            "left out what was stamped elsewhere in time" if leapt else "",
        )


def _stamp(scan: LidarScan) -> int:
    return scan.stamp_ns
