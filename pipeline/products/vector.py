"""The way as a line, and its poses as points, for QGIS (GeoPackage) and for Google Earth (KML)."""

from __future__ import annotations

import struct
from datetime import datetime, timezone
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import numpy.typing as npt
import pyogrio.raw

from pipeline.products.earth import Site
from pipeline.products.simplify import simplified

Array = npt.NDArray[np.float64]
_LINE_M = 0.1
"""The line leaves the way by at most this."""
_WKB_POINT_Z, _WKB_LINE_Z = 1001, 1002


def write_geopackage(
    path: Path, site: Site, stamps_ns: npt.NDArray[np.int64], enu_m: Array, columns: dict[str, Array]
) -> None:
    """Layers `way` (one line) and `poses` (points with time and `columns`, each (n,)), in the site's UTM zone."""
    path.unlink(missing_ok=True)
    utm = site.utm(enu_m)
    kept = simplified(utm, _LINE_M)
    length_m = float(np.linalg.norm(np.diff(enu_m, axis=0), axis=1).sum())
    line = np.array([_wkb_line(utm[kept])], dtype=object)
    _write(path, "way", line, site, {"length_m": np.array([length_m])}, kind="LineString Z", append=False)
    points = np.array([_wkb_point(point) for point in utm], dtype=object)
    times = stamps_ns.astype("datetime64[ns]").astype("datetime64[ms]")
    _write(path, "poses", points, site, {"time": times, **columns}, kind="Point Z", append=True)


def _write(
    path: Path,
    layer: str,
    geometry: npt.NDArray[np.object_],
    site: Site,
    columns: dict[str, npt.NDArray[np.generic]],
    *,
    kind: str,
    append: bool,
) -> None:
    pyogrio.raw.write(
        path,
        geometry,
        list(columns.values()),
        list(columns),
        layer=layer,
        driver="GPKG",
        geometry_type=kind,
        crs=f"EPSG:{site.epsg}",
        append=append,
    )


def write_kml(path: Path, site: Site, name: str, stamps_ns: npt.NDArray[np.int64], enu_m: Array) -> None:
    """One line on the ground, with the time span of the session."""
    kept = simplified(enu_m, _LINE_M)
    coordinates = " ".join(f"{lon:.8f},{lat:.8f},{h:.2f}" for lon, lat, h in site.geodetic(enu_m[kept]).tolist())
    begin, end = (_utc(int(stamps_ns[k])) for k in (0, -1))
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>\n'
        f"<name>{escape(name)}</name>\n"
        '<Style id="way"><LineStyle><color>ff0080ff</color><width>3</width></LineStyle></Style>\n'
        f"<Placemark><name>{escape(name)}</name><styleUrl>#way</styleUrl>"
        f"<TimeSpan><begin>{begin}</begin><end>{end}</end></TimeSpan>\n"
        f"<LineString><tessellate>1</tessellate><coordinates>{coordinates}</coordinates></LineString></Placemark>\n"
        "</Document></kml>\n",
        encoding="utf-8",
    )


def _utc(stamp_ns: int) -> str:
    return f"{datetime.fromtimestamp(stamp_ns // 1_000_000_000, timezone.utc):%Y-%m-%dT%H:%M:%SZ}"


def _wkb_point(point: Array) -> bytes:
    return struct.pack("<BI3d", 1, _WKB_POINT_Z, *point)


def _wkb_line(points: Array) -> bytes:
    return struct.pack("<BII", 1, _WKB_LINE_Z, len(points)) + np.ascontiguousarray(points, "<f8").tobytes()
