"""Which units a calibration belongs to, by their serial numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import msgspec

from edge.recording.calibration import About

LIDAR, CAMERA = "livox", "gopro"
"""Drivers whose sensors a calibration is about."""
_KEYS = ("serial number", "serial")
"""As the drivers tell them."""


class Units(msgspec.Struct, frozen=True):
    """Serial numbers; empty: not known."""

    lidar: str = ""
    camera: str = ""


def serial_of(details: Mapping[str, object]) -> str:
    """The serial number among what a sensor says of itself; empty where it does not tell."""
    return next((str(details[key]) for key in _KEYS if details.get(key)), "")


def others(about: About, units: Units) -> Iterator[str]:
    """In words, each unit that is another than the calibration's; what is not known is no other."""
    pairs = (("LiDAR", about.lidar_serial, units.lidar), ("camera", about.camera_serial, units.camera))
    for name, own, found in pairs:
        if own and found and own != found:
            yield f"made with {name} {own}, this one is {found}"
