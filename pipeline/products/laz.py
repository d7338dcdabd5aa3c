"""The map as LAZ 1.4, written tile by tile (ASPRS LAS 1.4 R15, point format 6)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
import numpy.typing as npt

from pipeline.products.earth import Site
from pipeline.products.findings import Evidence, PointEvidence
from pipeline.products.tiles import Tile, read_tile, tiles
from pipeline.products.track import Placement

SCALE_M = 0.001
_AT_ONCE = 250_000
"""Points: about 100 bytes each on the way."""
_GPS_EPOCH_S = 315_964_800
_LEAP_S = 18
"""GPS minus UTC, since 2017; none is announced."""
_ADJUSTED_S = 1_000_000_000
"""Adjusted standard GPS time counts from a billion seconds after the epoch (LAS 1.4, 2.4.1)."""
NO_HEAT = -1.0
"""Of points that no image showed; declared as no-data in the file."""
_ALWAYS = (
    laspy.ExtraBytesParams("sweep", "uint32", "ordinal in the trajectory"),
    laspy.ExtraBytesParams("sigma_m", "float32", "of the pose, horizontal"),
)
_OF_EVIDENCE = (
    laspy.ExtraBytesParams("heat", "float32", "probability; -1: not seen", no_data=np.array([NO_HEAT])),
    laspy.ExtraBytesParams("label", "uint8", "0 none, 1 ailanthus"),
    laspy.ExtraBytesParams("seen", "uint16", "images that showed the point"),
)
"""Descriptions have room for 32 bytes."""
_LOCAL = "coordinates are local: metres from the start of the session, z up, heading arbitrary; no CRS"


@dataclass(frozen=True, slots=True)
class MapSource:
    """What the map is made from. stamps_ns: (n,), sigma_m: (n,) horizontal sigma of the pose of each sweep."""

    tiles: Path
    voxel_m: float
    stamps_ns: npt.NDArray[np.int64]
    sigma_m: npt.NDArray[np.float64]
    placement: Placement | None
    session: str
    heights: str = "heights above the WGS 84 ellipsoid"
    evidence: Evidence | None = None
    """Of a detector: without it the points carry no heat, label and count."""
    number: int = 0
    """Of the session among several in one file: the point source ID."""
    moved: Mapping[Tile, npt.NDArray[np.bool_]] | None = None
    """Points of each tile that are left out, as the tile is read."""


def write_laz(path: Path, sources: Sequence[MapSource], advance: Callable[[float], None]) -> int:
    """Write to `path`; returns the number of points. One tile is in memory at a time. All sources have one frame."""
    found = [(source, tile) for source in sources for tile in tiles(source.tiles)]
    first = sources[0].placement
    site = Site(first.datum) if first is not None and first.datum is not None else None
    count = 0
    header = _header(sources, site)
    with laspy.open(path, mode="w", header=header, laz_backend=laspy.LazBackend.Lazrs) as writer:
        for number, (source, tile) in enumerate(found):
            points = read_tile(source.tiles, tile, source.voxel_m)
            if source.moved is not None:
                points = points[~source.moved[tile]]
            told = source.evidence(tile, points) if source.evidence is not None and _with_evidence(sources) else None
            for start in range(0, len(points), _AT_ONCE):
                some = slice(start, start + _AT_ONCE)
                record = _record(points[some], header, source, site)
                if told is not None:
                    _add_evidence(record, told, some)
                writer.write_points(record)
            count += len(points)
            advance((number + 1) / len(found))
    return count


def _header(sources: Sequence[MapSource], site: Site | None) -> laspy.LasHeader:
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = np.full(3, SCALE_M)
    header.offsets = np.zeros(3)
    if site is not None:
        header.offsets = np.floor(site.utm(np.zeros((1, 3)))[0])
    header.generating_software = "mapforest"
    header.system_identifier = "mapforest LiDAR map"
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    header.add_extra_dims([*_ALWAYS, *(_OF_EVIDENCE if _with_evidence(sources) else ())])
    _leave_bounds_open(header)
    names = [f"{one.session} (point source {one.number})" if one.number else one.session for one in sources]
    about = f"session {', '.join(names)}; " + (sources[0].heights if site else _LOCAL)
    header.vlrs.append(laspy.VLR("LASF_Spec", 3, "Text Area Description", about.encode()[:65_000]))
    if site is not None:
        header.add_crs(site.crs)
    return header


def _with_evidence(sources: Sequence[MapSource]) -> bool:
    return all(source.evidence is not None for source in sources)


def _leave_bounds_open(header: laspy.LasHeader) -> None:
    """laspy 2.7 takes the first value of each batch for the least and the greatest: better to say nothing."""
    for vlr in header.vlrs.get("ExtraBytesVlr"):
        for dimension in vlr.extra_bytes_structs:
            dimension.options &= ~(dimension.MIN_BIT_MASK | dimension.MAX_BIT_MASK)


def _record(
    points: npt.NDArray[np.void], header: laspy.LasHeader, source: MapSource, site: Site | None
) -> laspy.ScaleAwarePointRecord:
    sweeps = points["sweep"].astype(np.int64)
    xyz = points["xyz"].astype(np.float64)
    if source.placement is not None:
        xyz = source.placement.points(xyz, sweeps)
    if site is not None:
        xyz = site.utm_nearby(xyz)
    record = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
    record.x, record.y, record.z = xyz.T
    record.intensity = points["intensity"].astype(np.uint16) * 257
    record.return_number[:] = 1
    record.number_of_returns[:] = 1
    record.gps_time = adjusted_gps_s(source.stamps_ns[sweeps])
    record.point_source_id[:] = source.number
    record["sweep"] = points["sweep"]
    record["sigma_m"] = source.sigma_m[sweeps].astype(np.float32)
    return record


def _add_evidence(record: laspy.ScaleAwarePointRecord, told: PointEvidence, some: slice) -> None:
    seen = told.seen[some]
    record["heat"] = np.where(seen > 0, told.probability[some], np.float32(NO_HEAT))
    record["label"] = told.label[some]
    record["seen"] = seen


def adjusted_gps_s(utc_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """(n,) seconds as LAS wants them."""
    return np.asarray((utc_ns - (_GPS_EPOCH_S - _LEAP_S + _ADJUSTED_S) * 1_000_000_000) / 1e9)
