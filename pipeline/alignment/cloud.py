"""Point clouds of any size, a batch at a time: LAS, LAZ and PLY."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
import numpy.typing as npt
import pyproj

from pipeline import ply
from pipeline.alignment.errors import CloudError
from pipeline.alignment.grid import Array

AT_ONCE = 1_000_000
"""Points: about 100 MB on the way."""
GROUND = 2
NOISE = (7, 18)
"""Classes of LAS 1.4."""


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """What a file says of itself. low_m, high_m: (3,) corners, in units of the file."""

    path: Path
    count: int
    low_m: Array
    high_m: Array
    crs: pyproj.CRS | None


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """xyz_m: (n, 3). kind: (n,) class of LAS. intensity: (n,) 16 bits. gps_s: (n,), 0 where the file has no time."""

    xyz_m: Array
    kind: npt.NDArray[np.uint8]
    intensity: npt.NDArray[np.uint16]
    gps_s: Array

    def __len__(self) -> int:
        return len(self.xyz_m)


def inspect(path: Path) -> Cloud:
    """Reads the header of LAS, and all of a PLY.

    Raises `CloudError`.
    """
    if path.suffix.lower() == ".ply":
        return _inspect_ply(path)
    with _translated(path), laspy.open(path) as reader:
        header = reader.header
        if header.point_count == 0:
            raise CloudError(f"{path}: holds no points")
        return Cloud(path, header.point_count, header.mins.copy(), header.maxs.copy(), _crs(header))


def batches(cloud: Cloud, at_once: int = AT_ONCE) -> Iterator[Batch]:
    """All points, in the units and the frame of the file, without what is classified as noise."""
    if cloud.path.suffix.lower() == ".ply":
        for xyz in _ply(cloud.path, at_once):
            zeros = np.zeros(len(xyz))
            yield Batch(xyz, zeros.astype(np.uint8), zeros.astype(np.uint16), zeros)
        return
    with _translated(cloud.path), laspy.open(cloud.path) as reader:
        timed = "gps_time" in reader.header.point_format.dimension_names
        for points in reader.chunk_iterator(at_once):
            kind = np.asarray(points.classification, np.uint8)
            kept = ~np.isin(kind, NOISE)
            xyz = np.column_stack([points.x, points.y, points.z])[kept]
            gps = np.asarray(points.gps_time)[kept] if timed else np.zeros(len(xyz))
            yield Batch(xyz, kind[kept], np.asarray(points.intensity, np.uint16)[kept], gps)


def _inspect_ply(path: Path) -> Cloud:
    count, low, high = 0, np.full(3, np.inf), np.full(3, -np.inf)
    for xyz in _ply(path, AT_ONCE):
        count += len(xyz)
        low, high = np.minimum(low, xyz.min(axis=0)), np.maximum(high, xyz.max(axis=0))
    if count == 0:
        raise CloudError(f"{path}: holds no points")
    return Cloud(path, count, low, high, None)


def _ply(path: Path, at_once: int) -> Iterator[Array]:
    try:
        yield from ply.batches(path, at_once)
    except ply.PlyError as error:
        raise CloudError(str(error)) from error


def _crs(header: laspy.LasHeader) -> pyproj.CRS | None:
    try:
        found = header.parse_crs()
    except (pyproj.exceptions.CRSError, ValueError):
        return None
    return found if isinstance(found, pyproj.CRS) else None


@contextlib.contextmanager
def _translated(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise CloudError(f"{path}: cannot be read ({error.strerror or error})") from error
    except CloudError:
        raise
    except (laspy.errors.LaspyException, ValueError, RuntimeError, EOFError) as error:
        raise CloudError(
            f"{path}: no sound LAS or LAZ file ({error}); give LAS, LAZ, PLY, or a CSV of stems"
        ) from error
