"""When there is enough to start from, and how: at rest or in motion."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.messages import LidarScan
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.errors import StartRefused
from pipeline.odometry.filter import Filter
from pipeline.odometry.imu_buffer import ImuBuffer
from pipeline.odometry.initialise import force_scale, is_at_rest, start_at_rest, start_in_motion

SWEEP_NS = 100_000_000


def end_ns(scan: LidarScan) -> int:
    """Stamp of the last point; of an empty scan, when it should have ended."""
    return scan.stamp_ns + (int(scan.offset_ns.max()) if len(scan.offset_ns) else SWEEP_NS)


class Starter:
    """Looks at scans that wait until they give a first state. force_scale: see `initialise.force_scale`."""

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self.force_scale = 1.0
        self.awaits = ""
        """What is needed yet, after `first_state` gave none."""

    def first_state(self, waiting: Sequence[LidarScan], imu: ImuBuffer) -> Filter | None:
        """At the start of the first scan; None while more data is needed. StartRefused with what is missing."""
        first, longest_s = waiting[0], self._config.imu.longest_step_s
        window_ns = int(self._config.start.window_s * 1e9)
        if imu.gap_s(first.stamp_ns, end_ns(first)) > longest_s:
            raise StartRefused("no inertial samples with this scan")
        windows = [(first.stamp_ns - window_ns, first.stamp_ns), (first.stamp_ns, first.stamp_ns + window_ns)]
        whole = [(a, b) for a, b in windows if imu.covers(a, b, longest_s)]
        for begin, end in whole:
            rows = imu.window(begin, end)
            self.force_scale = force_scale(rows)
            rows[:, 4:7] *= self.force_scale
            if is_at_rest(rows, self._config):
                return start_at_rest(rows, self._config)
        if not whole and imu.newest_ns > first.stamp_ns + 2 * window_ns:
            raise StartRefused("the inertial samples with this scan have holes")
        count = self._config.start.moving_scans
        if not whole or len(waiting) < count or imu.newest_ns < end_ns(waiting[count - 1]):
            self.awaits = "a second of scans and inertial samples is needed to begin"
            return None
        return self._moving(waiting[:count], imu)

    def _moving(self, scans: Sequence[LidarScan], imu: ImuBuffer) -> Filter:
        ends = [end_ns(scan) for scan in scans]
        windows = [
            imu.between(begin, end, scan.stamp_ns)
            for begin, end, scan in zip([scans[0].stamp_ns, *ends[:-1]], ends, scans, strict=True)
        ]
        for rows in windows:
            rows[:, 4:7] *= self.force_scale
        return start_in_motion(list(scans), windows, self._config)
