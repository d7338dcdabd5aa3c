"""The calibration file, as the steps of a calibration complete it one after the other."""

from __future__ import annotations

import os
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import msgspec

from edge import toml_table
from edge.calibration.units import Units
from edge.errors import EdgeError
from edge.recording.calibration import CalibrationFile, load_calibration

_HEAD = "# Written by `mapforest calibrate`. What the keys mean: docs/calibration.md\n\n"


def today() -> str:
    """ISO date in UTC."""
    return f"{datetime.now(timezone.utc):%Y-%m-%d}"


def read_or_nominal(path: Path) -> CalibrationFile:
    """What is there to be completed; the nominal payload for a new file. ConfigError for a broken one."""
    return load_calibration(str(path)).file if path.exists() else CalibrationFile()


def with_units(file: CalibrationFile, units: Units, **about: Any) -> CalibrationFile:
    """Dated today, with the serial numbers that are known, and other changes of `about`."""
    told = {"lidar_serial": units.lidar, "camera_serial": units.camera}
    known = {key: value for key, value in told.items() if value}
    return msgspec.structs.replace(file, about=msgspec.structs.replace(file.about, date=today(), **known, **about))


def write(path: Path, file: CalibrationFile) -> None:
    """The whole file or nothing. EdgeError when the disk refuses."""
    beside = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with beside.open("w", encoding="utf-8") as stream:
            stream.write(_HEAD + toml_table.render(msgspec.to_builtins(file)))
            stream.flush()
            os.fsync(stream.fileno())
        beside.replace(path)
    except OSError as error:
        raise EdgeError(f"{path}: cannot be written ({error.strerror}); give another place with --file") from error
