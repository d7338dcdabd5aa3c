"""Text files as their readers take them."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pyogrio
import pytest

from pipeline.products.occurrences import UNVERIFIED, occurrences
from pipeline.products.tables import write_csv, write_darwin_core, write_geojson, write_imapinvasives
from tests.pipeline.products.stand import findings, survey


def rows(**other):
    return occurrences(replace(findings(), **other), survey())


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_geojson_is_of_the_standard_and_gdal_reads_it(tmp_path):
    write_geojson(tmp_path / "f.geojson", rows(), "walk")
    told = json.loads((tmp_path / "f.geojson").read_text(encoding="utf-8"))
    assert (told["type"], told["description"], "crs" in told) == ("FeatureCollection", UNVERIFIED, False)
    longitude, latitude, height = told["features"][0]["geometry"]["coordinates"]
    assert (longitude, latitude) == (rows()["longitude"][0], rows()["latitude"][0])
    assert height == rows()["ellipsoidal_height_m"][0]
    assert told["features"][2]["properties"]["height_m"] is None
    meta, _, shapes, fields = pyogrio.raw.read(tmp_path / "f.geojson")
    assert (meta["crs"] in {"EPSG:4326", "EPSG:4979"}, len(shapes)) == (True, 3)  # 4979: with ellipsoidal heights
    assert dict(zip(meta["fields"], fields, strict=True))["n_views"].tolist() == [12, 12, 12]


def test_imapinvasives_gets_what_its_upload_asks_for(tmp_path):
    write_imapinvasives(tmp_path / "i.csv", rows())
    first, *_ = found = table(tmp_path / "i.csv")
    assert list(first)[:6] == ["Source Unique ID", "Date", "Observer", "Latitude", "Longitude", "Species"]
    assert (first["Date"], first["Observer"], first["Species"]) == ("2026-09-21", "A. Walker", "Ailanthus altissima")
    assert float(first["Latitude"]) == pytest.approx(rows()["latitude"][0], abs=1e-8)
    assert all("unverified" in row["Comments"] for row in found)


def test_darwin_core_has_its_terms_and_an_uncertainty(tmp_path):
    write_darwin_core(tmp_path / "d.csv", rows())
    first, _, third = table(tmp_path / "d.csv")
    assert (first["basisOfRecord"], first["occurrenceStatus"]) == ("MachineObservation", "present")
    assert (first["identificationVerificationStatus"], first["geodeticDatum"]) == ("unverified", "EPSG:4326")
    assert first["eventDate"] == "2026-09-21T14:13:21Z/2026-09-21T14:13:26Z"
    assert float(first["coordinateUncertaintyInMeters"]) == pytest.approx(0.73, abs=0.01)
    assert json.loads(third["dynamicProperties"])["height_m"] is None
    assert "stem not seen" in third["occurrenceRemarks"]


def test_every_column_can_be_had_and_no_row_is_a_header_alone(tmp_path):
    write_csv(tmp_path / "all.csv", occurrences(findings(), survey(None)))
    assert np.array([row["x_m"] for row in table(tmp_path / "all.csv")], float).tolist() == [5.0, 9.0, 40.0]
    for write in (write_csv, write_darwin_core, write_imapinvasives):
        write(tmp_path / "none.csv", rows(trees=()))
        assert len((tmp_path / "none.csv").read_text().splitlines()) == 1
    write_geojson(tmp_path / "none.geojson", rows(trees=()), "walk")
    assert json.loads((tmp_path / "none.geojson").read_text())["features"] == []
