"""Point clouds of any driver as `LidarScan`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.messages import LidarScan
from edge.errors import FormatError
from edge.replay.point_times import Origin, PointTimes, find_field, find_times
from edge.replay.store import Raw
from edge.ros.decode import decode_custom_cloud, decode_point_cloud

CUSTOM_ENDING = "/CustomMsg"
_LINES = ("line", "ring", "channel")
_REFLECTIVITIES = ("reflectivity", "intensity")
_BRIGHTEST = 255.0
_LONGEST_NS = 2_000_000_000
"""A point farther from the first of its cloud has a broken time."""


@dataclass(frozen=True, slots=True)
class Cloud:
    """A cloud as decoded, whichever message it came in."""

    stamp_ns: int
    frame_id: str
    points: npt.NDArray[np.void]


@dataclass(frozen=True, slots=True)
class CloudLayout:
    """How the clouds of a topic are read; found once, from a few of them."""

    times: PointTimes
    reflectivity: str
    gain: float
    """Brings the reflectivity to 0..255."""
    line: str
    frame_id: str
    livox: bool

    def scan(self, cloud: Cloud, receive_ns: int) -> LidarScan | None:
        """The sweep without no-returns; None where nothing is left. Points keep their order."""
        points = cloud.points
        xyz = np.column_stack([points[axis] for axis in "xyz"]).astype(np.float32, copy=False)
        times_ns = self.times.absolute_ns(points[self.times.name], cloud.stamp_ns) if len(points) else np.empty(0, int)
        returned = np.isfinite(xyz).all(axis=1) & xyz.any(axis=1)
        if not returned.any():
            return None
        start_ns = int(times_ns[returned].min())
        returned &= times_ns - start_ns < _LONGEST_NS
        return LidarScan(
            stamp_ns=start_ns,
            receive_ns=receive_ns,
            xyz_m=xyz[returned],
            reflectivity=self._octets(points, self.reflectivity, self.gain)[returned],
            tag=self._octets(points, "tag" if self.livox else "", 1.0)[returned],
            line=self._octets(points, self.line, 1.0)[returned],
            offset_ns=(times_ns[returned] - start_ns).astype(np.uint32),
        )

    @staticmethod
    def _octets(points: npt.NDArray[np.void], name: str, gain: float) -> npt.NDArray[np.uint8]:
        if not name:
            return np.zeros(len(points), np.uint8)
        values = points[name]
        if values.dtype == np.uint8 and gain == 1.0:
            return np.array(values, np.uint8)
        scaled = np.nan_to_num(np.asarray(values, np.float32) * gain)
        octets: npt.NDArray[np.uint8] = np.clip(np.rint(scaled), 0, _BRIGHTEST).astype(np.uint8)
        return octets


def decode_cloud(type_name: str, data: bytes | memoryview) -> Cloud:
    """PointCloud2 or Livox CustomMsg. FormatError."""
    if type_name.endswith(CUSTOM_ENDING):
        custom = decode_custom_cloud(data)
        # The offsets count from the time base; some drivers stamp the message later.
        return Cloud(custom.timebase_ns or custom.stamp_ns, custom.frame_id, custom.points)
    found = decode_point_cloud(data)
    return Cloud(found.stamp_ns, found.frame_id, found.points)


def find_layout(topic: str, type_name: str, some: Iterable[Raw], time_field: str = "") -> CloudLayout:
    """The layout of a topic, from some of its messages. FormatError says what is missing."""
    clouds = [cloud for raw in some if len((cloud := decode_cloud(type_name, raw.data)).points)]
    if not clouds:
        raise FormatError(f"{topic}: its clouds are empty; the LiDAR saw nothing, or was not turning")
    names = clouds[0].points.dtype.names or ()
    if missing := [axis for axis in "xyz" if axis not in names]:
        raise FormatError(f"{topic}: its points have no {', '.join(missing)} (fields {', '.join(names)})")
    if time_field and time_field not in names:
        raise FormatError(f"{topic}: its points have no field {time_field!r}; they have {', '.join(names)}")
    livox = type_name.endswith(CUSTOM_ENDING) or {"tag", "line", "timestamp"} <= set(names)
    name = time_field or find_field(names, topic)
    if type_name.endswith(CUSTOM_ENDING):
        times = PointTimes(name, 1, Origin.STAMP)
        _refuse_equal(topic, name, clouds)
    else:
        times = find_times(topic, name, [_of_returns(c, name) for c in clouds], [c.stamp_ns for c in clouds])
    reflectivity = next((field for field in _REFLECTIVITIES if field in names), "")
    return CloudLayout(
        times=times,
        reflectivity=reflectivity,
        gain=1.0 if livox or not reflectivity else _gain(clouds, reflectivity),
        line=next((field for field in _LINES if field in names), ""),
        frame_id=clouds[0].frame_id,
        livox=livox,
    )


def _refuse_equal(topic: str, name: str, clouds: Sequence[Cloud]) -> None:
    if not any(np.ptp(cloud.points[name]) for cloud in clouds):
        raise FormatError(f"{topic}: all points of a cloud have the same {name!r}; update the LiDAR's driver")


def _of_returns(cloud: Cloud, name: str) -> npt.NDArray[np.generic]:
    """Times of the points that are there: drivers leave those of no-returns at zero."""
    points = cloud.points
    there = (points["x"] != 0) | (points["y"] != 0) | (points["z"] != 0)
    return np.asarray(points[name][there])


def _gain(clouds: Sequence[Cloud], name: str) -> float:
    values = np.concatenate([cloud.points[name].astype(np.float64) for cloud in clouds])
    brightest = float(np.nanpercentile(values, 99.9)) if len(values) else 0.0
    if brightest <= 0.0 or 1.0 < brightest <= _BRIGHTEST:
        return 1.0
    return _BRIGHTEST / (1.0 if brightest <= 1.0 else brightest)
