"""Anybody's map, by the kind of its file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pipeline.inventory.errors import InventoryError
from pipeline.inventory.las import LasMap
from pipeline.inventory.ply import PlyMap
from pipeline.inventory.source import MapSource

KINDS: dict[str, Callable[[Path], MapSource]] = {".las": LasMap, ".laz": LasMap, ".ply": PlyMap}


def open_map(path: Path) -> MapSource:
    """Of a LAS, LAZ or PLY file. InventoryError when it is none, is damaged, empty, or not in metres."""
    kind = KINDS.get(path.suffix.lower())
    if kind is None:
        raise InventoryError(f"{path}: expected a session, or a map as .las, .laz or .ply")
    if not path.is_file():
        raise InventoryError(f"{path}: there is no such file")
    return kind(path)
