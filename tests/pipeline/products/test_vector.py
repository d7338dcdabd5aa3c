"""GeoPackages are what GDAL and SQLite read out of them."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pyogrio
import pytest
import shapely

from pipeline.products.coverage import CoverageGrid
from pipeline.products.handout import Handout
from pipeline.products.occurrences import UNVERIFIED
from pipeline.products.styles import STATUSES
from pipeline.products.vector import add_findings, add_styles, write_way
from tests.pipeline.products.stand import DATUM, SITE, START_NS, findings, survey

LAYERS = ["track", "poses", "detections", "patches", "searched_area", "layer_styles"]


def read(path, layer):
    meta, _, shapes, fields = pyogrio.raw.read(path, layer=layer)
    return meta, shapely.from_wkb(shapes), dict(zip(meta["fields"], fields, strict=True))


def package(path, found=None, walk=None):
    walk = walk or survey()
    write_way(path, walk, {"sigma_m": np.full(81, 0.5)}, {"fix_types": "RTK fixed 90%", "sigma_rms_m": 0.2})
    add_findings(path, Handout.of(found if found is not None else findings(), walk, 5.0))
    add_styles(path)
    return path


def test_the_way_is_a_line_and_its_poses_are_points(tmp_path):
    walk = survey()
    write_way(tmp_path / "a.gpkg", walk, {"sigma_m": np.full(81, 0.5)}, {"fix_types": "none"})
    meta, points, poses = read(tmp_path / "a.gpkg", "poses")
    assert (meta["crs"], len(points)) == ("EPSG:32618", 81)
    np.testing.assert_allclose(shapely.get_coordinates(points, include_z=True), SITE.utm(walk.positions_m), atol=1e-6)
    times = poses["time"].astype("datetime64[ms]").astype(int)
    np.testing.assert_allclose(times, walk.stamps_ns // 10**6, atol=1)
    _, (line,), track = read(tmp_path / "a.gpkg", "track")
    assert track["length_m"][0] == pytest.approx(40.0)
    assert (track["run_id"][0], track["event_start"][0], track["fix_types"][0]) == (walk.session, walk.start, "none")
    assert len(line.coords) < 10  # a straight way needs few


def test_detections_are_in_wgs_84_and_areas_in_the_grid(tmp_path):
    path = package(tmp_path / "f.gpkg")
    assert pyogrio.list_layers(path)[:, 0].tolist() == LAYERS
    meta, points, rows = read(path, "detections")
    assert meta["crs"] == "EPSG:4326"
    np.testing.assert_allclose(shapely.get_coordinates(points), np.column_stack([rows["longitude"], rows["latitude"]]))
    assert abs(rows["latitude"][0] - DATUM[0]) < 1e-3
    assert rows["tree_id"].tolist() == [1, 2, 7]
    assert np.isnan(rows["height_m"][2])
    meta, outlines, grown = read(path, "patches")
    assert (meta["crs"], grown["trees"].tolist(), grown["n_trees"].tolist()) == ("EPSG:32618", ["1, 2", "7"], [2, 1])
    np.testing.assert_allclose(shapely.area(outlines), grown["gross_area_m2"] * SITE.scale**2, rtol=0.01)
    np.testing.assert_allclose(
        grown["percent_cover"], 100 * grown["infested_area_m2"] / grown["gross_area_m2"], atol=0.1
    )
    _, (searched,), told = read(path, "searched_area")
    assert told["area_m2"][0] * SITE.scale**2 == pytest.approx(searched.area, rel=1e-4)  # on the ground, not the grid
    assert (told["n_detections"][0], told["n_images"][0]) == (3, 1200)
    trees = SITE.utm(np.array([tree.position_m for tree in findings().trees]))[:, :2]
    assert shapely.contains(searched, shapely.points(trees)).all()


def test_qgis_finds_a_style_for_every_layer(tmp_path):
    path = package(tmp_path / "f.gpkg")
    with sqlite3.connect(path) as base:
        found = base.execute(  # as QGIS asks
            "select f_table_schema, f_table_name, f_geometry_column, styleQML, useAsDefault from layer_styles "
            "order by update_time desc"
        )
        styles = {name: (schema, column, qml, used) for schema, name, column, qml, used in found}
        shapes = dict(base.execute("select table_name, column_name from gpkg_geometry_columns"))
        kinds = dict(base.execute("select table_name, data_type from gpkg_contents"))
        (version,) = base.execute("pragma user_version").fetchone()
        (about,) = base.execute("select description from gpkg_contents where table_name = 'detections'").fetchone()
    base.close()
    assert styles.keys() == shapes.keys() == set(LAYERS[:-1])
    assert all((schema, column, used) == ("", shapes[name], 1) for name, (schema, column, _, used) in styles.items())
    assert version <= 10300  # GDAL 3.6 of Debian 12 warns of what is newer
    assert (kinds["layer_styles"], about) == ("attributes", UNVERIFIED)
    drawn = ElementTree.fromstring(styles["detections"][2].partition("\n")[2])
    assert [one.get("value") for one in drawn.iter("category")] == list(STATUSES)
    assert drawn.find(".//field[@name='crop']/editWidget").get("type") == "ExternalResource"


def test_nothing_found_is_said_by_the_searched_area(tmp_path):
    path = package(tmp_path / "f.gpkg", replace(findings(), trees=()))
    assert pyogrio.list_layers(path)[:, 0].tolist() == LAYERS
    assert [len(read(path, layer)[1]) for layer in ("detections", "patches", "searched_area")] == [0, 0, 1]
    full = read(package(tmp_path / "g.gpkg"), "detections")[0]
    assert read(path, "detections")[0]["fields"].tolist() == full["fields"].tolist()


def test_nothing_searched_is_an_empty_area(tmp_path):
    path = package(tmp_path / "f.gpkg", replace(findings(), trees=(), coverage=CoverageGrid()))
    assert read(path, "searched_area")[1][0].is_empty


def test_a_local_package_lies_nowhere_on_the_earth(tmp_path):
    path = package(tmp_path / "f.gpkg", walk=survey(None))
    for layer in LAYERS[:-1]:
        crs = pyogrio.read_info(path, layer=layer)["crs"]
        assert crs.startswith("LOCAL_CS"), crs
    _, points, rows = read(path, "detections")
    np.testing.assert_allclose(shapely.get_coordinates(points), np.column_stack([rows["x_m"], rows["y_m"]]))


def test_the_same_findings_keep_their_identities(tmp_path):
    first, second = (package(tmp_path / name) for name in ("a.gpkg", "b.gpkg"))
    for layer in ("detections", "patches", "searched_area"):
        assert read(first, layer)[2]["uuid"].tolist() == read(second, layer)[2]["uuid"].tolist()
    assert START_NS // 10**9 == 1_790_000_000
