"""What a detector found becomes files, on the Earth or local, and `products.json` tells of each."""

from __future__ import annotations

import json
import math
import sqlite3
from contextlib import closing
from dataclasses import replace

import laspy
import numpy as np
import pyogrio
import pytest
import rasterio

from edge.config import Products
from edge.errors import EdgeError
from edge.process.places import Places
from edge.process.products_stage import ProductsStage
from tests.edge.process.handed import found, hand_out

ON_EARTH = {
    "detections.msgpack",
    "findings.gpkg",
    "detections.geojson",
    "detections.qml",
    "findings.kml",
    "findings.kmz",
    "findings_imapinvasives.csv",
    "findings_darwin_core.csv",
    "evidence.tif",
    "evidence.qml",
    "DCIM",
}
LOCAL = {"findings_local.gpkg", "findings_local.csv", "DCIM"}


def names(folder):
    return {path.name for path in folder.iterdir()} - {"work", "products.json"}


def test_findings_are_handed_out_in_every_format(recording, tmp_path):
    folder, facts = hand_out(recording, found(tmp_path / "given"), observer="A. Walker")
    assert names(folder) == set(facts.files)
    assert set(facts.files) >= ON_EARTH
    assert not (LOCAL - {"DCIM"}) & set(facts.files)
    told = facts.findings
    assert (told.trees, told.patches, told.images, told.model) == (3, 2, 1200, "toh-yolo")
    assert told.searched_m2 == pytest.approx(2400, rel=0.02)
    cloud = laspy.read(folder / "map.laz")
    assert set(np.array(cloud.heat)) == {0.25}
    meta, _, _, fields = pyogrio.raw.read(folder / "findings.gpkg", layer="detections")
    rows = dict(zip(meta["fields"], fields, strict=True))
    assert rows["observer"].tolist() == ["A. Walker"] * 3
    assert all((folder / crop).stat().st_size > 1000 for crop in rows["crop"] if crop)
    with rasterio.open(folder / "evidence.tif") as raster:
        assert raster.crs.to_epsg() == 32632
        assert "nobody has verified" in raster.tags()["warning"]


def test_a_session_without_a_place_gets_local_files_that_say_so(recording, tmp_path):
    folder, facts = hand_out(recording, found(tmp_path / "given", "odom"), gnss=False)
    assert names(folder) == set(facts.files)
    assert set(facts.files) >= LOCAL
    assert not {name for name in facts.files if name.endswith((".kml", ".kmz", ".tif", ".geojson"))}
    assert facts.georeference is None
    assert all("no place on the Earth" in facts.files[name] for name in LOCAL - {"DCIM"})
    assert "heat" in laspy.read(folder / "map_local.laz").point_format.extra_dimension_names


def test_trees_in_another_frame_are_refused(recording, tmp_path):
    with pytest.raises(EdgeError, match="do the grounding again"):
        hand_out(recording, found(tmp_path / "given", "odom"))


def test_without_a_detector_there_are_none_of_them_and_old_ones_go(recording, tmp_path):
    folder, _ = hand_out(recording, found(tmp_path / "given"))
    stage = ProductsStage(Places.of(folder / "work"), folder, Products(), "walk", "mapforest")
    facts = stage.run(lambda _: None)
    assert names(folder) == set(facts.files)
    assert not ON_EARTH & set(facts.files)
    assert facts.findings is None
    assert list(laspy.read(folder / "map.laz").point_format.extra_dimension_names) == ["sweep", "sigma_m"]


def test_what_people_verified_is_never_lost(recording, tmp_path):
    given = found(tmp_path / "given")
    folder, _ = hand_out(recording, given)
    with closing(sqlite3.connect(folder / "findings.gpkg")) as package:
        # GDAL's triggers want functions that SQLite alone does not have.
        for (name,) in package.execute("select name from sqlite_master where type = 'trigger'").fetchall():
            package.execute(f'drop trigger "{name}"')
        package.execute("update detections set verification_status = 'confirmed' where tree_id = 7")
        package.commit()
    _, facts = hand_out(recording, given)
    (kept,) = folder.glob("findings_verified_*.gpkg")
    assert f"1 trees in findings.gpkg had been verified: it was kept as {kept.name}" in facts.notes
    _, _, _, (status,) = pyogrio.raw.read(kept, layer="detections", columns=["verification_status"])
    assert sorted(status) == ["confirmed", "unverified", "unverified"]
    _, again = hand_out(recording, given)
    assert not any("verified" in note for note in again.notes)
    (folder / "findings.gpkg").write_bytes(b"torn")
    hand_out(recording, given)


def test_nothing_found_is_handed_out_too(recording, tmp_path):
    _, facts = hand_out(recording, replace(found(tmp_path / "given"), trees=()))
    assert set(facts.files) >= ON_EARTH - {"DCIM"}
    assert (facts.findings.trees, facts.findings.infested_m2) == (0, 0.0)


@pytest.mark.parametrize(("geoid", "undulation"), [(-33.5, -33.5), ("none", None), ("receiver", None)])
def test_the_reference_is_told(recording, tmp_path, geoid, undulation):
    folder, _ = hand_out(recording, found(tmp_path / "given"), geoid=geoid)
    told = json.loads((folder / "products.json").read_text())["georeference"]
    assert (told["epsg"], told["undulation_m"]) == (32632, undulation)
    assert told["convergence_deg"] == pytest.approx(
        math.degrees(math.radians(-1.0) * math.sin(math.radians(47))), rel=1e-3
    )
    assert ("orthometric = ellipsoidal" in told["heights"]) == (undulation is not None)
    with laspy.open(folder / "map.laz") as cloud:
        about = next(vlr for vlr in cloud.header.vlrs if vlr.record_id == 3)
    assert told["heights"].encode() in about.record_data
