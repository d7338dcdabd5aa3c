"""The GeoTIFF holds what the grid holds, at the place where it is, and tells unsearched from empty."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import rasterio
import rasterio.transform
from rasterio.warp import transform

from pipeline.products.coverage import CoverageGrid
from pipeline.products.earth import Site
from pipeline.products.raster import preview, write_geotiff
from tests.pipeline.products.stand import SITE, coverage, trees

TAGS = {"session": "walk"}


@pytest.mark.parametrize("datum", [SITE.datum, (-33.9, 18.4, 0.0), (65.0, 12.0, 100.0)])
def test_every_pixel_is_the_cell_below_it(tmp_path, datum):
    site, grid = Site(datum), coverage()
    assert write_geotiff(tmp_path / "e.tif", site, grid, TAGS)
    with rasterio.open(tmp_path / "e.tif") as raster:
        bands = raster.read()
        rows, columns = (side.ravel() for side in np.mgrid[: raster.height, : raster.width])
        easting, northing = rasterio.transform.xy(raster.transform, rows, columns)
        # The way back by GDAL's own projection; east and north at the datum from the closed form of `Site`.
        longitude, latitude = transform(raster.crs, "EPSG:4326", easting, northing)
        cells = grid.sample(site.from_geodetic(np.array(longitude), np.array(latitude)))
    expected = np.stack([cells.probability, np.where(cells.views, cells.views, np.nan), cells.sigma_m])
    same = (bands.reshape(3, -1) == expected) | (np.isnan(bands.reshape(3, -1)) & np.isnan(expected))
    assert same.mean() > 0.999  # centres of pixels on the edge of a cell may fall to either side
    found = np.count_nonzero(~np.isnan(bands[0])) * 0.25
    assert found == pytest.approx(grid.area_m2 * site.scale**2, rel=0.01)


def test_searched_and_empty_is_not_unsearched(tmp_path):
    write_geotiff(tmp_path / "e.tif", SITE, coverage(), TAGS)
    with rasterio.open(tmp_path / "e.tif") as raster:
        assert (raster.crs.to_epsg(), raster.dtypes, np.isnan(raster.nodata)) == (32618, ("float32",) * 3, True)
        assert raster.descriptions == ("evidence", "count", "uncertainty")
        assert raster.units == ("probability", "images", "m")
        assert raster.tags()["session"] == "walk"
        at_tree, empty, outside = (
            next(raster.sample(SITE.utm(np.array([place]))[:, :2]))
            for place in (trees()[0].position_m, [0.0, -20.0, 0.0], [-10.6, 0.0, 0.0])
        )
    assert at_tree[0] > 0.9
    np.testing.assert_allclose(empty, [1 / (1 + np.exp(4.0)), 2, 0.2], rtol=1e-5)
    assert np.isnan(outside).all()
    assert [path.name for path in tmp_path.iterdir()] == ["e.tif"]


def test_a_large_one_is_cloud_optimised_with_overviews(tmp_path):
    grid = CoverageGrid(0.5)
    way = np.column_stack([np.arange(0, 1500, 0.25), 200 * np.sin(np.arange(0, 1500, 0.25) / 200)])
    grid.see(way, 0.3)
    write_geotiff(tmp_path / "e.tif", SITE, grid, TAGS)
    with rasterio.open(tmp_path / "e.tif") as raster:
        assert raster.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert raster.overviews(1) == [2, 4, 8]
        assert raster.block_shapes[0] == (512, 512)
        coarse = raster.read(2, out_shape=(raster.height // 8, raster.width // 8))
    assert np.nanmax(coarse) == 1.0  # an average with what is no-data does not dilute
    assert np.isnan(coarse).mean() > 0.5


def test_the_preview_lies_where_the_trees_are_and_is_clear_where_nobody_looked():
    laid = preview(SITE, coverage())
    picture = cv2.imdecode(np.frombuffer(laid.png, np.uint8), cv2.IMREAD_UNCHANGED)
    height, width, _ = picture.shape

    def colour(place):
        longitude, latitude, _ = SITE.geodetic(np.array([place]))[0]
        column = (longitude - laid.west) / (laid.east - laid.west) * width
        row = (laid.north - latitude) / (laid.north - laid.south) * height
        return picture[int(row), int(column)].tolist()

    blue, green, red, alpha = colour(trees()[0].position_m)
    assert red > 150 > green > blue
    assert alpha > 200
    assert 60 < colour([0.0, -20.0, 0.0])[3] < 120
    nothing = CoverageGrid(0.5)
    nothing.see(np.array([[0.0, 0.0], [300.0, 200.0]]), 0.1)
    alone = cv2.imdecode(np.frombuffer(preview(SITE, nothing).png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert np.count_nonzero(alone[:, :, 3]) == 2
    assert preview(SITE, CoverageGrid()) is None


def test_a_preview_of_a_long_walk_keeps_its_single_cells():
    grid = CoverageGrid(0.5)
    grid.see(np.array([[0.1, 0.1], [1000.3, 5.1], [4000.1, 40.1]]), 0.1)
    picture = cv2.imdecode(np.frombuffer(preview(SITE, grid).png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert max(picture.shape) <= 2048
    assert np.count_nonzero(picture[:, :, 3]) == 3


def test_nothing_searched_makes_no_file(tmp_path):
    assert not write_geotiff(tmp_path / "e.tif", SITE, CoverageGrid(), TAGS)
    assert not list(tmp_path.iterdir())
