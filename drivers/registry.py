"""The sensors this program knows, as import strings: naming one imports nothing until it is used.

A driver package offers `Config`, a frozen msgspec structure with a default for every field, and `Sensor`,
a class built as `Sensor(name, config)` that satisfies `drivers.driver.Driver`.
"""

from __future__ import annotations

import importlib
from typing import Any

DRIVERS: dict[str, tuple[str, str]] = {
    "livox": ("drivers.livox.config:Config", "drivers.livox.driver:Sensor"),
    "reach": ("drivers.reach.config:Config", "drivers.reach.driver:Sensor"),
    "gopro": ("drivers.gopro.config:Config", "drivers.gopro.driver:Sensor"),
}
"""driver name -> (configuration structure, driver class)."""


def config_type(driver: str) -> type[Any]:
    """The configuration structure of a driver. KeyError names an unknown driver."""
    return _load(DRIVERS[driver][0])


def driver_type(driver: str) -> type[Any]:
    """The class of a driver. KeyError names an unknown driver."""
    return _load(DRIVERS[driver][1])


def _load(path: str) -> type[Any]:
    module, _, name = path.partition(":")
    loaded: type[Any] = getattr(importlib.import_module(module), name)
    return loaded
