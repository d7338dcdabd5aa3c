"""The one TOML file, as typed, frozen structures. Every key has a default that is safe in the field."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from drivers import registry
from edge import toml_table
from edge.errors import ConfigError
from pipeline.gnss.config import FusionConfig
from pipeline.grounding.config import GroundingConfig
from pipeline.inventory.config import InventoryConfig
from pipeline.odometry.config import OdometryConfig
from pipeline.refinement.config import RefinementConfig

Positive = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Percent = Annotated[float, msgspec.Meta(ge=0, le=90)]
Count = Annotated[int, msgspec.Meta(gt=0)]
Port = Annotated[int, msgspec.Meta(ge=0, le=65535)]


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
    odometry: str = "/odometry"
    gnss_pose: str = "/gnss/pose"
    tf: str = "/tf"
    detections: str = "/detections"


class Mission(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Defaults for what a start request does not say."""

    name: str = "mission"
    operator: str = ""
    carrier: str = "handheld"


class Recording(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a session is written."""

    folder: str = "~/mapforest/recordings"
    split_s: Positive = 60.0
    split_mib: Count = 1024
    queue_mib: Count = 256
    """Holds 7 s of a stalled card at more than three times the nominal data rate."""
    reserve_percent: Percent = 12.5
    """Share of the queue that only IMU, GNSS and events may use."""
    compression: Literal["none", "lz4", "zstd"] = "none"
    chunk_kib: Annotated[int, msgspec.Meta(ge=16, le=1024)] = 1024
    flush_s: Positive = 1.0
    min_free_mib: Annotated[int, msgspec.Meta(ge=0)] = 2048
    min_free_percent: Percent = 3.0
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
    port: Port = 8765
    lidar_hz: Positive = 2.0
    """Scans a second sent to viewers; the file always gets all of them."""


class Bus(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the recorder and the live pipeline tell each other, on sockets beside the control socket."""

    enabled: bool = True


class Products(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `mapforest process` makes."""

    voxel_m: Positive = 0.05
    """The map keeps one point in each cube of this size, and the retro-reflectors."""
    tile_m: Positive = 16.0
    memory_mib: Count = 96
    """The growing map in memory; the rest waits on the disk."""
    geoid: Literal["receiver", "none"] | float = "receiver"
    """Metres of the geoid above the ellipsoid at the site, for orthometric heights; "receiver": as it says itself."""
    patch_gap_m: NotNegative = 5.0
    """Trees whose crowns come closer to each other than this are one patch."""
    observer: str = ""
    """Who answers for what was found, as databases know them; empty: the operator of the recording."""
    organization: str = ""


class Detection(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Detection in the camera's images, live and afterwards."""

    model: str = ""
    """Path of an ONNX file, "demo" for the one that comes along, or empty for no detection."""
    confidence: Share = 0.0
    """Least score of a box. 0: what the model's file advises, 0.35 where it says nothing."""
    iou: Share = 0.0
    """Boxes of one class that overlap by more are one. 0: what the model's file advises, 0.5 where it says nothing."""
    rate_hz: Positive = 2.0
    """Images a second that are looked at; live at most."""
    threads: Annotated[int, msgspec.Meta(ge=0)] = 0
    """0: one live, as many as there are cores afterwards."""
    device: Literal["auto", "tensorrt", "cuda", "cpu"] = "auto"
    core_share: Positive = 0.5
    """Of one core, live at most: fewer images are looked at before more is taken."""
    hot_c: Positive = 85.0
    """From ten degrees below on ever fewer images are looked at."""
    cache: str = ""
    """Folder for what TensorRT builds; empty: the cache of the service or of the user."""


class Expectation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What validation expects of one topic."""

    rate_hz: NotNegative
    tolerance: Share = 0.1
    required: bool = True
    max_gap_s: NotNegative = 0.0
    """0: five nominal periods, at least half a second."""


class Validation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Expected topics by name, added to the defaults of the sensors that are configured."""

    topics: dict[str, Expectation] = {}
    min_fix_share: Share = 0.5
    """Share of GNSS epochs with any fix below which a recording is WARN."""
    max_clock_sigma_ms: Positive = 5.0


def _default_sensors() -> dict[str, dict[str, Any]]:
    return {name: {"driver": name} for name in registry.DRIVERS}


class Config(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file. In `sensors`, the key `driver` of each table picks the driver; the rest belongs to it."""

    mission: Mission = Mission()
    recording: Recording = Recording()
    control: Control = Control()
    live: Live = Live()
    validation: Validation = Validation()
    topics: Topics = Topics()
    odometry: OdometryConfig = OdometryConfig()
    fusion: FusionConfig = FusionConfig()
    grounding: GroundingConfig = GroundingConfig()
    inventory: InventoryConfig = InventoryConfig()
    products: Products = Products()
    refinement: RefinementConfig = RefinementConfig()
    detection: Detection = Detection()
    bus: Bus = Bus()
    calibration: str = ""
    """Path of the calibration file; empty: the nominal geometry of the payload."""
    sensors: dict[str, dict[str, Any]] = msgspec.field(default_factory=_default_sensors)


def load(path: Path | None) -> Config:
    """Read and check the file, driver tables included; defaults when `path` is None.

    ConfigError names the file, the key as written (`recording.split_s`), what was found, what is expected, and
    the nearest known key for an unknown one.
    """
    if path is None:
        return Config()
    return check(toml_table.read(path), str(path))


def check(tables: dict[str, Any], source: str) -> Config:
    """The configuration that parsed TOML says. ConfigError as `load`."""
    config = toml_table.convert(tables, Config, source)
    for name in config.sensors:
        sensor_settings(config, name, source)
    return config


def sensor_driver(config: Config, name: str, source: str = "configuration") -> str:
    """The driver of a sensor: the key `driver` of its table, or the name of the table itself."""
    key = f"sensors.{name}.driver"
    driver = config.sensors[name].get("driver", name)
    if not isinstance(driver, str):
        raise ConfigError(f"{source}: {key}: found {driver!r}, expected a text in quotes")
    if driver not in registry.DRIVERS:
        raise ConfigError(f"{source}: {key}: unknown driver {driver!r}: {toml_table.nearest(driver, registry.DRIVERS)}")
    return driver


def sensor_settings(config: Config, name: str, source: str = "configuration") -> msgspec.Struct:
    """The driver's own configuration of a sensor, checked. ConfigError as `load`."""
    driver = sensor_driver(config, name, source)
    settings = {key: value for key, value in config.sensors[name].items() if key != "driver"}
    kind: type[msgspec.Struct] = registry.config_type(driver)
    return toml_table.convert(settings, kind, source, f"sensors.{name}")


def to_toml(config: Config) -> str:
    """The configuration in effect, every default and driver table spelled out: what goes into each recording."""
    tables = msgspec.to_builtins(config)
    for name in config.sensors:
        settings = msgspec.to_builtins(sensor_settings(config, name))
        tables["sensors"][name] = {"driver": sensor_driver(config, name), **settings}
    return toml_table.render(tables)
