"""The one TOML file, as typed, frozen structures. Every key has a default that is safe in the field."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec


class Topics(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Topic names. They are what other programs look for."""

    lidar: str = "/livox/lidar"
    imu: str = "/livox/imu"
    fix: str = "/gnss/fix"
    nmea: str = "/gnss/nmea"
    video: str = "/camera/video"
    diagnostics: str = "/diagnostics"
    events: str = "/events"
    tf_static: str = "/tf_static"


class Mission(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Defaults for what a start request does not say."""

    name: str = "mission"
    operator: str = ""
    carrier: str = "handheld"


class Recording(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a session is written."""

    folder: str = "~/mapforest/recordings"
    split_s: float = 60.0
    split_mib: int = 1024
    queue_mib: int = 256
    """Holds 7 s of a stalled card at more than three times the nominal data rate."""
    reserve_percent: float = 12.5
    """Share of the queue that only IMU, GNSS and events may use."""
    compression: str = "none"
    chunk_kib: int = 1024
    flush_s: float = 1.0
    min_free_mib: int = 2048
    min_free_percent: float = 3.0
    require_mount: bool = False
    """Refuse to record when `folder` is not below a mount point of its own (the card is missing)."""


class Control(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where the control socket is. Empty: the runtime directory of the service or of the user."""

    socket: str = ""
    group: str = ""


class Live(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Live view for Foxglove."""

    enabled: bool = False
    host: str = "127.0.0.1"
    port: int = 8765
    lidar_hz: float = 2.0
    """Scans a second sent to viewers; the file always gets all of them."""


class Expectation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What validation expects of one topic."""

    rate_hz: float
    tolerance: float = 0.1
    required: bool = True
    max_gap_s: float = 0.0
    """0: five nominal periods, at least half a second."""


class Validation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Expected topics by name, added to the defaults of the sensors that are configured."""

    topics: dict[str, Expectation] = {}
    min_fix_share: float = 0.5
    """Share of GNSS epochs with any fix below which a recording is WARN."""
    max_clock_sigma_ms: float = 5.0


class Config(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file. In `sensors`, the key `driver` of each table picks the driver; the rest belongs to it."""

    mission: Mission = Mission()
    recording: Recording = Recording()
    control: Control = Control()
    live: Live = Live()
    validation: Validation = Validation()
    topics: Topics = Topics()
    calibration: str = ""
    """Path of the calibration file; empty: the nominal geometry of the payload."""
    sensors: dict[str, dict[str, Any]] = {
        "livox": {"driver": "livox"},
        "reach": {"driver": "reach"},
        "gopro": {"driver": "gopro"},
    }


def load(path: Path | None) -> Config:
    """Read and check the file, driver tables included; defaults when `path` is None.

    ConfigError names the file, the key as written (`recording.split_s`), what was found, what is expected, and
    the nearest known key for an unknown one.
    """
    raise NotImplementedError
