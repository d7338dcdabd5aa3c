"""An aerial and a ground map in one LAZ 1.4 file, every point with its source."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
import numpy.typing as npt
import pyproj

from pipeline.alignment.cloud import Batch
from pipeline.products.laz import SCALE_M

AERIAL, TERRESTRIAL = 1, 2
_SOURCE = laspy.ExtraBytesParams("source", "uint8", "1 aerial, 2 terrestrial")


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """Both maps in one frame, read batch by batch. near_m: (2,) any place of it."""

    aerial: Iterable[Batch]
    terrestrial: Iterable[Batch]
    crs: pyproj.CRS | None
    near_m: npt.NDArray[np.float64]
    count: int
    about: str


def write_merged(path: Path, merged: Merged, advance: Callable[[float], None]) -> int:
    """Returns the number of points. Classes, intensities and times are kept."""
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = np.full(3, SCALE_M)
    header.offsets = np.append(np.floor(merged.near_m), 0.0)
    header.generating_software = "mapforest"
    header.system_identifier = "mapforest merged map"
    header.add_extra_dims([_SOURCE])
    header.vlrs.append(laspy.VLR("LASF_Spec", 3, "Text Area Description", merged.about.encode()[:65_000]))
    if merged.crs is not None:
        header.add_crs(merged.crs)
    count = 0
    with laspy.open(path, mode="w", header=header, laz_backend=laspy.LazBackend.Lazrs) as writer:
        for source, batch in _labelled(merged):
            writer.write_points(_record(batch, source, header))
            count += len(batch)
            advance(min(count / max(merged.count, 1), 1.0))
    return count


def _labelled(merged: Merged) -> Iterator[tuple[int, Batch]]:
    for batch in merged.aerial:
        yield AERIAL, batch
    for batch in merged.terrestrial:
        yield TERRESTRIAL, batch


def _record(batch: Batch, source: int, header: laspy.LasHeader) -> laspy.ScaleAwarePointRecord:
    record = laspy.ScaleAwarePointRecord.zeros(len(batch), header=header)
    record.x, record.y, record.z = batch.xyz_m.T
    record.classification = batch.kind
    record.intensity = batch.intensity
    record.gps_time = batch.gps_s
    record.return_number[:] = 1
    record.number_of_returns[:] = 1
    record.point_source_id[:] = source
    record["source"] = np.full(len(batch), source, np.uint8)
    return record
