"""KML as a phone opens it: well-formed, in the schema's order, at the place, with its pictures inside."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from xml.etree import ElementTree

import cv2
import numpy as np
import pyogrio
import pytest

from pipeline.products.handout import Handout
from pipeline.products.kml import write_findings_kml, write_kml, write_kmz
from pipeline.products.raster import preview
from tests.pipeline.products.stand import SITE, coverage, findings, survey

K = {"k": "http://www.opengis.net/kml/2.2"}
ORDER = [
    "name",
    "description",
    "TimeStamp",
    "TimeSpan",
    "styleUrl",
    "ExtendedData",
    "Point",
    "MultiGeometry",
    "LineString",
]
"""Of a Placemark's children in the schema of KML 2.2: a sequence, not a set."""


def parse(text):
    root = ElementTree.fromstring(text)
    for mark in root.iter(f"{{{K['k']}}}Placemark"):
        places = [ORDER.index(child.tag.partition("}")[2]) for child in mark]
        assert places == sorted(places)
    return root


def handout(folder=None):
    return Handout.of(findings(folder), survey(), 5.0)


def test_the_way_is_a_line_at_its_place(tmp_path):
    walk = replace(survey(), session="walk <1> & back")
    write_kml(tmp_path / "a.kml", walk)
    root = parse((tmp_path / "a.kml").read_bytes())
    assert root.findtext(".//k:Placemark/k:name", namespaces=K) == "walk <1> & back"
    ends = [list(map(float, word.split(","))) for word in root.findtext(".//k:coordinates", namespaces=K).split()]
    np.testing.assert_allclose(ends[0], SITE.geodetic(walk.positions_m[:1])[0, :2], atol=1e-7)
    np.testing.assert_allclose(ends[-1], SITE.geodetic(walk.positions_m[-1:])[0, :2], atol=1e-7)


def test_trees_carry_their_table_and_gdal_reads_it(tmp_path):
    given = handout()
    write_findings_kml(tmp_path / "f.kml", given)
    root = parse((tmp_path / "f.kml").read_bytes())
    names = [mark.findtext("k:name", namespaces=K) for mark in root.iterfind(".//k:Folder[1]/k:Placemark", K)]
    assert names == ["Tree 1 (93%)", "Tree 2 (93%)", "Tree 7 (51%)"]
    data = {
        one.get("name"): one.findtext("k:value", namespaces=K) for one in root.iterfind(".//k:Placemark[1]//k:Data", K)
    }
    assert data["uuid"] == given.rows["uuid"][0]
    assert "crop" not in data
    assert {"Detections (3)", "Patches"} <= set(pyogrio.list_layers(tmp_path / "f.kml")[:, 0])
    _, _, shapes, _ = pyogrio.raw.read(tmp_path / "f.kml", layer="Detections (3)")
    x, y = np.frombuffer(shapes[0], "<f8", 2, offset=5)
    assert (x, y) == pytest.approx((given.rows["longitude"][0], given.rows["latitude"][0]), abs=1e-8)


def test_rings_run_against_the_clock(tmp_path):
    write_findings_kml(tmp_path / "f.kml", handout())
    root = parse((tmp_path / "f.kml").read_bytes())
    rings = list(root.iterfind(".//k:outerBoundaryIs//k:coordinates", K))
    assert len(rings) == 3
    for ring in rings:
        x, y = np.array([list(map(float, word.split(","))) for word in ring.text.split()]).T
        assert np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0


def test_the_kmz_has_its_pictures_with_it_and_small(tmp_path):
    given = handout(tmp_path)
    write_kmz(tmp_path / "f.kmz", given, preview(SITE, coverage()))
    with zipfile.ZipFile(tmp_path / "f.kmz") as packed:
        names = packed.namelist()
        assert names[0] == "doc.kml"  # programs take the first KML they meet
        text = packed.read("doc.kml").decode()
        pictures = [name for name in names if name.endswith(".jpg")]
        assert pictures == [given.rows["crop"][0], given.rows["crop"][2]]
        for name in pictures:
            assert f'src="{name}"' in text.replace("&quot;", '"')
            assert max(cv2.imdecode(np.frombuffer(packed.read(name), np.uint8), cv2.IMREAD_COLOR).shape) == 480
    box = parse(text).find(".//k:GroundOverlay/k:LatLonBox", K)
    sides = {child.tag.partition("}")[2]: float(child.text) for child in box}
    assert list(sides) == ["north", "south", "east", "west"]
    assert sides["south"] < given.rows["latitude"].min() < given.rows["latitude"].max() < sides["north"]


def test_a_session_without_a_place_has_no_kml(tmp_path):
    with pytest.raises(ValueError, match="without a place on the Earth"):
        write_kml(tmp_path / "a.kml", survey(None))
