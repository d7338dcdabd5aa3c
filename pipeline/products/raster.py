"""Evidence on a raster: a cloud-optimised GeoTIFF in the site's UTM zone, and a picture to lay over the Earth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import rasterio
import rasterio.shutil
from rasterio.transform import Affine
from rasterio.windows import Window

from pipeline.products.coverage import CoverageGrid, Sampled
from pipeline.products.earth import Site
from pipeline.products.styles import RAMP

Array = npt.NDArray[np.float64]
Bounds = tuple[float, float, float, float]
ToMap = Callable[[Array], Array]
BANDS = (
    ("evidence", "probability", "that the tree that is looked for stands here; 0: searched, nothing speaks for it"),
    ("count", "images", "that showed the place unhidden"),
    ("uncertainty", "m", "one sigma, horizontal, of where things seen here are"),
)
"""Name, unit, meaning. Where nobody searched all of them are no-data, which is NaN."""
_WINDOW = 512
"""Pixels: over so few the way to `map` is affine to a millimetre."""
_PREVIEW_PX = 2048


@dataclass(frozen=True, slots=True)
class Overlay:
    """A picture (PNG, RGBA) and its edges in degrees. Transparent: not searched."""

    png: bytes
    west: float
    south: float
    east: float
    north: float


@dataclass(frozen=True, slots=True)
class _Frame:
    """Where pixels lie: the upper left corner, and the steps to the right (positive) and down (negative)."""

    west: float
    north: float
    right: float
    down: float
    rows: int
    columns: int


def write_geotiff(path: Path, site: Site, coverage: CoverageGrid, tags: Mapping[str, str]) -> bool:
    """The nearest cell in each pixel. False when nothing was searched: no file is made then."""
    searched = coverage.bounds_m()
    if searched is None:
        return False
    cell = coverage.cell_m
    edges = site.utm(_outline(searched))[:, :2] / cell
    (west, south), (east, north) = np.floor(edges.min(axis=0)) * cell, np.ceil(edges.max(axis=0)) * cell
    frame = _Frame(west, north, cell, -cell, round((north - south) / cell), round((east - west) / cell))
    plain = path.with_name(f"{path.name}.plain")
    try:
        with rasterio.open(plain, "w", **_profile(site, frame)) as raster:
            _describe(raster, tags)
            for window, cells in _sampled(coverage, site.from_utm, frame):
                raster.write(np.stack([cells.probability, _count(cells), cells.sigma_m]), window=window)
        rasterio.shutil.copy(plain, path, driver="COG", compress="deflate", predictor="yes", resampling="average")
    finally:
        plain.unlink(missing_ok=True)
    return True


def preview(site: Site, coverage: CoverageGrid) -> Overlay | None:
    """The evidence in the colours of `RAMP`, in longitude and latitude; None when nothing was searched."""
    searched = coverage.bounds_m()
    if searched is None:
        return None
    edges = site.geodetic(_outline(searched))[:, :2]
    (west, south), (east, north) = edges.min(axis=0).tolist(), edges.max(axis=0).tolist()
    across, up = (round((searched[k + 2] - searched[k]) / coverage.cell_m) + 1 for k in (0, 1))
    coarser = 2 ** max(0, int(np.ceil(np.log2(max(across, up) / _PREVIEW_PX))))
    rows, columns = -(-up // coarser) * coarser, -(-across // coarser) * coarser
    frame = _Frame(west, north, (east - west) / columns, (south - north) / rows, rows, columns)
    strongest = np.full((rows // coarser, columns // coarser), np.nan, np.float32)
    for window, cells in _sampled(coverage, lambda at: site.from_geodetic(at[:, 0], at[:, 1]), frame):
        high, wide = (side // coarser for side in cells.probability.shape)
        pooled = np.fmax.reduce(cells.probability.reshape(high, coarser, wide, coarser), axis=(1, 3))
        top, left = window.row_off // coarser, window.col_off // coarser
        strongest[top : top + high, left : left + wide] = pooled
    return Overlay(_coloured(strongest), west, south, east, north)


def _profile(site: Site, frame: _Frame) -> dict[str, object]:
    return {
        "driver": "GTiff",
        "height": frame.rows,
        "width": frame.columns,
        "count": len(BANDS),
        "dtype": "float32",
        "nodata": np.nan,
        "crs": f"EPSG:{site.epsg}",
        "transform": Affine(frame.right, 0.0, frame.west, 0.0, frame.down, frame.north),
        "tiled": True,
        "blockxsize": _WINDOW,
        "blockysize": _WINDOW,
        "bigtiff": "if_safer",
    }


def _describe(raster: rasterio.io.DatasetWriter, tags: Mapping[str, str]) -> None:
    raster.update_tags(AREA_OR_POINT="Area", **tags)
    for number, (name, unit, meaning) in enumerate(BANDS, 1):
        raster.set_band_description(number, name)
        raster.set_band_unit(number, unit)
        raster.update_tags(number, meaning=meaning)


def _count(cells: Sampled) -> npt.NDArray[np.float32]:
    return np.where(cells.views > 0, cells.views, np.nan).astype(np.float32)


def _sampled(coverage: CoverageGrid, to_map: ToMap, frame: _Frame) -> Iterator[tuple[Window, Sampled]]:
    """Window by window, arrays (rows, columns). to_map: (n, 2) in the raster's CRS -> (n, 2) in `map`."""
    for top in range(0, frame.rows, _WINDOW):
        for left in range(0, frame.columns, _WINDOW):
            rows, columns = min(_WINDOW, frame.rows - top), min(_WINDOW, frame.columns - left)
            found = coverage.sample(_places(to_map, frame, Window(left, top, columns, rows)))
            yield Window(left, top, columns, rows), found.reshaped(rows, columns)


def _places(to_map: ToMap, frame: _Frame, window: Window) -> Array:
    """(rows * columns, 2) centres of a window's pixels in `map`, by the affine map at its middle."""
    size = np.array([window.width, window.height])
    middle, step = size / 2.0, size / 4.0
    probes = np.array([window.col_off, window.row_off]) + middle + np.array([*np.eye(2), *-np.eye(2), [0, 0]]) * step
    there = to_map(np.array([frame.west, frame.north]) + probes * (frame.right, frame.down))
    right, down = (there[:2] - there[2:4]) / (2.0 * step[:, None])
    x, y = np.meshgrid(np.arange(size[0]) + 0.5 - middle[0], np.arange(size[1]) + 0.5 - middle[1])
    return np.asarray(there[4] + x.reshape(-1, 1) * right + y.reshape(-1, 1) * down)


def _outline(bounds: Bounds) -> Array:
    """(n, 3) corners and middles of edges: turned into another CRS they enclose all between them."""
    west, south, east, north = bounds
    x, y = np.meshgrid(np.linspace(west, east, 9), np.linspace(south, north, 9))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def _coloured(probability: npt.NDArray[np.float32]) -> bytes:
    at, colours = [value for value, _ in RAMP], np.array([colour for _, colour in RAMP], np.float64)
    known = np.nan_to_num(probability)
    red, green, blue, alpha = (np.interp(known, at, channel).round().astype(np.uint8) for channel in colours.T)
    alpha[np.isnan(probability)] = 0
    return bytes(cv2.imencode(".png", np.dstack([blue, green, red, alpha]))[1])
