"""How well a sensor's clock was estimated, against the true line that its emulator wrote."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Nanoseconds = npt.NDArray[np.int64]
STEP_NS = 50_000_000
"""A change of (host - sensor) between two truth samples beyond this starts a new epoch of the clock."""


@dataclass(frozen=True, slots=True)
class ClockTruth:
    """host_ns, sensor_ns: (n,) int64, the same instants on both clocks, in order of host time."""

    host_ns: Nanoseconds
    sensor_ns: Nanoseconds


@dataclass(frozen=True, slots=True)
class ClockEstimates:
    """What the driver believed, row by row: at host time `at_ns`, sensor time `sensor_ns` is host time + `offset_ns`.

    All (n,): at_ns, sensor_ns, offset_ns int64; skew_ppm, sigma_ns float64.
    """

    at_ns: Nanoseconds
    sensor_ns: Nanoseconds
    offset_ns: Nanoseconds
    skew_ppm: npt.NDArray[np.float64]
    sigma_ns: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ClockErrors:
    """Estimated minus true. `latency_ms` is the median error: a constant delay that no arrival can show."""

    samples: int
    epochs: int
    latency_ms: float
    rms_ms: float
    """About the median."""
    worst_ms: float
    skew_ppm: float
    true_skew_ppm: float
    within_3_sigma: float
    """Share of rows whose error about the median is inside three stated sigmas."""


def clock_errors(estimates: ClockEstimates, truth: ClockTruth, settle_s: float = 10.0) -> ClockErrors:
    """Compare, leaving out `settle_s` of host time at the start of each epoch. ValueError when nothing is left."""
    starts = _epoch_starts(truth)
    start_ns = truth.host_ns[starts]
    epoch = np.searchsorted(start_ns, estimates.at_ns, side="right") - 1
    settled = (epoch >= 0) & (estimates.at_ns - start_ns[np.maximum(epoch, 0)] > settle_s * 1e9)
    error_ns, true_skew = np.full(estimates.at_ns.size, np.nan), np.full(len(starts), np.nan)
    for index, (first, last) in enumerate(zip(starts, [*starts[1:], truth.host_ns.size], strict=True)):
        line = _Line.fit(truth.host_ns[first:last], truth.sensor_ns[first:last])
        rows = settled & (epoch == index)
        error_ns[rows] = estimates.sensor_ns[rows] + estimates.offset_ns[rows] - line.host_ns(estimates.sensor_ns[rows])
        true_skew[index] = line.skew * 1e6
    rows = np.isfinite(error_ns)
    if not rows.any():
        raise ValueError(f"no clock estimate is older than {settle_s:.0f} s in its epoch: record for longer")
    return _summary(error_ns[rows], estimates.sigma_ns[rows], estimates.skew_ppm[rows], true_skew, len(starts))


def _summary(
    error_ns: npt.NDArray[np.float64],
    sigma_ns: npt.NDArray[np.float64],
    skew_ppm: npt.NDArray[np.float64],
    true_skew_ppm: npt.NDArray[np.float64],
    epochs: int,
) -> ClockErrors:
    latency_ns = float(np.median(error_ns))
    scatter_ns = error_ns - latency_ns
    return ClockErrors(
        samples=error_ns.size,
        epochs=epochs,
        latency_ms=latency_ns / 1e6,
        rms_ms=float(np.sqrt(np.mean(scatter_ns**2))) / 1e6,
        worst_ms=float(np.abs(scatter_ns).max()) / 1e6,
        skew_ppm=float(skew_ppm[-1]),
        true_skew_ppm=float(true_skew_ppm[np.isfinite(true_skew_ppm)][-1]),
        within_3_sigma=float(np.mean(np.abs(scatter_ns) <= 3.0 * sigma_ns)),
    )


def _epoch_starts(truth: ClockTruth) -> npt.NDArray[np.int64]:
    jumps = np.abs(np.diff(truth.host_ns - truth.sensor_ns)) > STEP_NS
    return np.concatenate(([0], np.flatnonzero(jumps) + 1))


@dataclass(frozen=True, slots=True)
class _Line:
    """host - sensor as a straight line; the reference keeps float64 exact to nanoseconds."""

    sensor_ref_ns: int
    difference_ref_ns: int
    skew: float

    @classmethod
    def fit(cls, host_ns: Nanoseconds, sensor_ns: Nanoseconds) -> _Line:
        span = (sensor_ns - sensor_ns[0]).astype(np.float64)
        difference = host_ns - sensor_ns
        moved = (difference - difference[0]).astype(np.float64)
        skew = float(span @ moved / (span @ span)) if span.size > 1 else 0.0
        return cls(int(sensor_ns[0]), int(difference[0]), skew)

    def host_ns(self, sensor_ns: Nanoseconds) -> npt.NDArray[np.float64]:
        since = (sensor_ns - self.sensor_ref_ns).astype(np.float64)
        return np.asarray(sensor_ns + self.difference_ref_ns + np.rint(self.skew * since), dtype=np.float64)
