"""What each topic of a recording should look like: from the sensors configured, or by its type."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from edge.config import Config, Expectation
from edge.validation.index import Topic

_POINTS = ("PointCloud2", "CustomMsg")


@dataclass(frozen=True, slots=True)
class Expected:
    """what, advice: words for people. types: accepted endings of the type name, empty for any.

    nominal_hz 0: any rate will do. A gap above max_gap_s is a warning, above fail_gap_s a failure.
    """

    what: str
    advice: str
    types: tuple[str, ...]
    nominal_hz: float
    min_hz: float
    max_hz: float
    required: bool
    max_gap_s: float
    fail_gap_s: float
    orders_motion: bool = False
    """Odometry needs its stamps in order."""


def default_gap_s(rate_hz: float) -> float:
    """Five nominal periods, at least half a second."""
    return max(0.5, 5 / rate_hz) if rate_hz > 0 else 2.0


_LIDAR = Expected(
    "the laser scanner",
    "Check its power and its Ethernet cable.",
    _POINTS,
    10.0,
    9.0,
    11.0,
    required=True,
    max_gap_s=0.5,
    fail_gap_s=2.0,
    orders_motion=True,
)
_IMU = replace(
    _LIDAR, what="the motion sensor of the laser scanner", types=("/Imu",), nominal_hz=200.0, min_hz=180.0, max_hz=220.0
)
_FIX = Expected(
    "the GNSS receiver",
    "Check its cable and that it is set to send NMEA at 5 Hz or more.",
    ("/NavSatFix",),
    5.0,
    4.5,
    math.inf,
    required=True,
    max_gap_s=1.0,
    fail_gap_s=30.0,
)
_NMEA = replace(_FIX, what="the raw sentences of the GNSS receiver", types=("/Sentence",), nominal_hz=0.0, min_hz=0.0)
_VIDEO = Expected(
    "the camera",
    "Check its battery, and that its Wi-Fi or USB link holds.",
    ("/CompressedVideo", "/CompressedImage", "/Image"),
    29.97,
    27.0,
    33.0,
    required=True,
    max_gap_s=2.0,  # the preview restarts when the camera begins its own recording: about a second
    fail_gap_s=5.0,
)
_DIAGNOSTICS = Expected(
    "the recorder's own health report",
    "The recorder was overloaded; look at the CPU and the card.",
    ("/DiagnosticArray",),
    1.0,
    0.5,
    2.0,
    required=False,
    max_gap_s=5.0,
    fail_gap_s=math.inf,
)
_TF_STATIC = Expected(
    "the mounting geometry of the sensors",
    "Give the calibration file to whatever reads the recording.",
    ("/TFMessage",),
    0.0,
    0.0,
    math.inf,
    required=True,
    max_gap_s=math.inf,
    fail_gap_s=math.inf,
)
_BY_TYPE = {"PointCloud2": _LIDAR, "CustomMsg": _LIDAR, "Imu": _IMU, "NavSatFix": _FIX, "CompressedVideo": _VIDEO}
_BY_TYPE |= {"CompressedImage": _VIDEO, "Image": _VIDEO}


def of_session(config: Config) -> dict[str, Expected]:
    """Topics of a session of ours, by name."""
    drivers = {str(table.get("driver", name)) for name, table in config.sensors.items() if table.get("enabled", True)}
    topics = config.topics
    found = {topics.diagnostics: _DIAGNOSTICS, topics.tf_static: _TF_STATIC}
    if "livox" in drivers:
        found |= {topics.lidar: _LIDAR, topics.imu: _IMU}
    if "reach" in drivers:
        found |= {topics.fix: _FIX, topics.nmea: _NMEA}
    if "gopro" in drivers:
        found |= {topics.video: _VIDEO}
    return _with_named(found, config)


def of_foreign(topics: dict[str, Topic], typical_hz: dict[str, float], config: Config) -> dict[str, Expected]:
    """Topics of a recording made by others, recognised by type and judged against their own typical rate."""
    found: dict[str, Expected] = {}
    for name, topic in topics.items():
        base = _BY_TYPE.get(topic.type_name.rsplit("/", 1)[-1])
        rate_hz = typical_hz.get(name, 0.0)
        if base is None or rate_hz <= 0:
            continue
        gap_s = default_gap_s(rate_hz)
        found[name] = replace(
            base,
            types=(),
            nominal_hz=rate_hz,
            min_hz=0.9 * rate_hz,
            max_hz=math.inf,
            required=False,
            max_gap_s=gap_s,
            fail_gap_s=math.inf,
        )
    return _with_named(found, config)


def _with_named(found: dict[str, Expected], config: Config) -> dict[str, Expected]:
    """The topics named in `[validation.topics]` take precedence."""
    return found | {name: _named(name, e, found.get(name)) for name, e in config.validation.topics.items()}


def _named(name: str, expectation: Expectation, base: Expected | None) -> Expected:
    rate_hz = expectation.rate_hz
    gap_s = expectation.max_gap_s or default_gap_s(rate_hz)
    base = base or replace(_DIAGNOSTICS, what=name, advice="Check the sensor that sends it.", types=())
    return replace(
        base,
        nominal_hz=rate_hz,
        min_hz=rate_hz * (1 - expectation.tolerance),
        max_hz=rate_hz * (1 + expectation.tolerance) if rate_hz > 0 else math.inf,
        required=expectation.required,
        max_gap_s=gap_s,
        fail_gap_s=max(base.fail_gap_s if math.isfinite(base.fail_gap_s) else 2.0, 4 * gap_s),
    )
