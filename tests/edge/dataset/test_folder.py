"""A dataset on the disk comes back as it was, also after a power cut, and others' YOLO folders are read."""

from __future__ import annotations

import csv
import struct

import cv2
import pytest

from edge.dataset.folder import DatasetFolder
from edge.dataset.image import image_facts
from edge.errors import EdgeError, FormatError
from tests.edge.dataset import scenes
from tests.edge.dataset.scenes import BOX


def test_records_classes_and_labels_come_back(tmp_path):
    made = scenes.dataset(tmp_path / "d", 3, ("ailanthus", "sumac"), source="field", site="wood", stamp_ns=2**60 + 1)
    scenes.label(made, p0=[BOX], p1=[])
    again = DatasetFolder.open(tmp_path / "d")
    assert again.records == made.records
    assert again.classes == ["ailanthus", "sumac"]
    assert again.boxes() == [(BOX,), (), None]
    rows = list(csv.DictReader((tmp_path / "d" / "sites.csv").read_text().splitlines()))
    assert rows[0] == {"image": "p0.png", "site": "wood", "source": "field", "session": "", "split": ""}


def test_a_line_that_a_power_cut_tore_is_left_out_and_the_next_one_starts_anew(tmp_path):
    made = scenes.dataset(tmp_path / "d", 3)
    manifest = tmp_path / "d" / "manifest.jsonl"
    manifest.write_bytes(manifest.read_bytes()[:-40])
    again = DatasetFolder.make(tmp_path / "d")
    assert again.records == made.records[:2]
    again.add(made.records[2], scenes.png(2))
    assert DatasetFolder.open(tmp_path / "d").records == made.records


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ('{"image": "a.png"}', "manifest.jsonl:1: .*sha256"),
        ("nonsense", "manifest.jsonl:1"),
        ('{"image": "../a.png", "sha256": "", "width_px": 1, "height_px": 1}', "not the name of a file"),
        ('{"image": "a.png", "sha256": "", "width_px": 0, "height_px": 1}', "manifest.jsonl:1"),
        ('{"image": "a.png", "sha256": "", "width_px": 1, "height_px": 1, "phash": "xyz"}', "phash"),
    ],
)
def test_a_manifest_that_is_wrong_is_named_with_its_line(tmp_path, line, why):
    scenes.dataset(tmp_path / "d", 1)
    manifest = tmp_path / "d" / "manifest.jsonl"
    manifest.write_text(line + "\n" + manifest.read_text())
    with pytest.raises(FormatError, match=why):
        DatasetFolder.open(tmp_path / "d")


def test_images_of_no_site_are_told_apart_by_their_source(tmp_path):
    scenes.dataset(tmp_path / "d", 1, source="inaturalist")
    rows = list(csv.DictReader((tmp_path / "d" / "sites.csv").read_text().splitlines()))
    assert rows[0]["site"] == "inaturalist"


@pytest.mark.parametrize("heading", ["", "image,site\n"])
def test_a_yolo_folder_of_somebody_else_is_looked_at(tmp_path, heading):
    theirs = scenes.dataset(tmp_path / "d", 2)
    scenes.label(theirs, p0=[BOX])
    (tmp_path / "d" / "manifest.jsonl").unlink()
    (tmp_path / "d" / "sites.csv").write_text(f"{heading}p0.png,wood\np1,moor\n")
    found = DatasetFolder.open(tmp_path / "d")
    assert [(r.image, r.site, r.source) for r in found.records] == [
        ("p0.png", "wood", "other"), ("p1.png", "moor", "other")
    ]  # fmt: skip
    assert found.records[0].sha256 == theirs.records[0].sha256
    assert found.boxes() == [(BOX,), None]


def test_labels_that_are_no_boxes_are_named(tmp_path):
    made = scenes.dataset(tmp_path / "d", 2)
    made.label_path(made.records[1]).write_text("0 0.5 0.5 0.1 0.1\n1 0.5 0.5 0.1 0.1\n")
    with pytest.raises(FormatError, match=r"labels/p1.txt:2: class 1, but classes.txt has 1 rows"):
        made.boxes()


def test_what_is_no_dataset_and_where_none_can_be_made_is_said(tmp_path):
    with pytest.raises(FormatError, match="not a dataset"):
        DatasetFolder.open(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(EdgeError, match="--output"):
        DatasetFolder.make(tmp_path / "file")


@pytest.mark.parametrize(("orientation", "size"), [(1, (96, 64)), (6, (64, 96))])
def test_a_photo_has_the_size_it_is_shown_with(orientation, size):
    jpeg = cv2.imencode(".jpg", scenes.picture(1))[1].tobytes()
    exif = b"Exif\0\0MM\0*" + struct.pack(">IHHHIHHI", 8, 1, 0x0112, 3, 1, orientation, 0, 0)
    turned = jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:]
    facts = image_facts(turned, "photo")
    assert (facts.width_px, facts.height_px) == size


@pytest.mark.parametrize("data", [b"", b"\xff\xd8\xff", b"GIF89a"])
def test_what_is_no_image_is_an_error(data):
    with pytest.raises(FormatError, match=r"a\.jpg: not an image"):
        image_facts(data, "a.jpg")
