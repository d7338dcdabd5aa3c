"""Labels as people and programs write them, and what is said of wrong ones."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.evaluation.dataset import read_boxes, read_dataset
from pipeline.evaluation.errors import DatasetError
from tests.pipeline.evaluation import labels

REAL = Path(__file__).parents[3] / "../shared/data/detection"
TRUTH = {"a": labels.boxes([(0, 0.1, 0.2, 0.5, 0.6), (1, 0.0, 0.0, 1.0, 1.0)]), "deep/b.1": labels.boxes([])}


def test_a_dataset_comes_back_as_it_was_written(tmp_path):
    labels.write(tmp_path, TRUTH, ("ailanthus", "sumac"), {"a": "trail", "deep/b.1.png": "meadow"})
    found = read_dataset(tmp_path)
    assert (found.class_names, found.sites, found.notes) == (("ailanthus", "sumac"), ("meadow", "trail"), ())
    assert [(image.name, image.site) for image in found.images] == [("a", "trail"), ("deep/b.1", "meadow")]
    np.testing.assert_allclose(found.images[0].truth.boxes, TRUTH["a"].boxes)
    assert found.images[0].truth.class_id.tolist() == [0, 1]
    assert found.images[1].path == tmp_path / "images/deep/b.1.png"


def test_what_does_not_fit_together_is_told(tmp_path):
    labels.write(tmp_path, TRUTH, ("a", "b"))
    (tmp_path / "labels/a.txt").rename(tmp_path / "labels/lonely.txt")
    (tmp_path / "sites.csv").write_text("deep/b.1,meadow\nelsewhere,trail\n")
    found = read_dataset(tmp_path)
    assert [image.site for image in found.images] == ["no site", "meadow"]
    assert found.notes == (
        "1 images of sites.csv that are not there: elsewhere",
        "1 images without labels, taken as showing nothing: a",
        "1 labels without an image, left out: lonely",
    )


def test_labels_alone_are_enough_and_that_is_no_error(tmp_path):
    found = read_dataset(labels.write(tmp_path, TRUTH, ("a", "b"), images=False))
    assert [image.path for image in found.images] == [None, None]
    assert found.notes == ("no sites.csv: nothing is told by site",)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("0 0.5 0.5 0.2 0.4", (0.4, 0.3, 0.6, 0.7)),
        ("0 0.1 0.2 0.5 0.1 0.3 0.9", (0.1, 0.1, 0.5, 0.9)),
        ("1 0.1 0.1 0.2 0.2 0.3 0.1 0.25 0.05", (0.1, 0.05, 0.3, 0.2)),
        ("0 0.99 0.5 0.04 0.2", (0.97, 0.4, 1.0, 0.6)),
    ],
)
def test_boxes_and_polygons_are_read_and_clipped(tmp_path, line, expected):
    path = tmp_path / "a.txt"
    path.write_text(line + "\n\n")
    np.testing.assert_allclose(read_boxes(path, 2).boxes, [expected])


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("0 0.5 0.5 0.2", "4 values; a box has 5"),
        ("0 0.1 0.1 0.2 0.2 0.3", "6 values; a box has 5"),
        ("0 0.1 0.1 0.2 0.2 0.3 0.1 0.2", "8 values; a box has 5"),
        ("2 0.5 0.5 0.2 0.2", "class 2, but classes.txt has 2 rows"),
        ("-1 0.5 0.5 0.2 0.2", "class '-1' is not a row"),
        ("0.5 0.5 0.5 0.2 0.2", "class '0.5' is not a row"),
        ("0 120 80 40 20", "far outside"),
        ("0 0.5 0.5 0 0.2", "has no area"),
        ("0 0.5 0.5 nan 0.2", "not a number"),
        ("tree 0.5 0.5 0.2 0.2", "'tree' is not a number"),
    ],
)
def test_a_wrong_line_is_named(tmp_path, line, told):
    path = tmp_path / "a.txt"
    path.write_text("0 0.5 0.5 0.2 0.2\n" + line)
    with pytest.raises(DatasetError, match=told) as caught:
        read_boxes(path, 2)
    assert str(caught.value).startswith(f"{path}:2: ")


def test_a_prediction_needs_its_confidence(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("0 0.5 0.5 0.2 0.2 0.75")
    assert read_boxes(path, 1, predicted=True).confidence.tolist() == [0.75]
    path.write_text("0 0.5 0.5 0.2 0.2")
    with pytest.raises(DatasetError, match="without a confidence"):
        read_boxes(path, 1, predicted=True)


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda folder: (folder / "classes.txt").unlink(), "classes.txt: cannot be read"),
        (lambda folder: (folder / "classes.txt").write_text("a\na\n"), "each once"),
        (lambda folder: (folder / "sites.csv").write_text("a\n"), "sites.csv:1: expected an image and its site"),
        (lambda folder: (folder / "labels/a.txt").write_bytes(b"\xff\xfe"), "a.txt: cannot be read"),
        (lambda folder: (folder / "images/a.jpg").touch(), "another ending"),
    ],
)
def test_a_broken_folder_is_told(tmp_path, spoil, told):
    spoil(labels.write(tmp_path, TRUTH, ("a", "b")).absolute())
    with pytest.raises(DatasetError, match=told):
        read_dataset(tmp_path)


def test_a_folder_that_is_none_is_told(tmp_path):
    with pytest.raises(DatasetError, match="no such folder"):
        read_dataset(tmp_path / "gone")
    (tmp_path / "classes.txt").write_text("a")
    with pytest.raises(DatasetError, match="neither images/ nor labels/"):
        read_dataset(tmp_path)


@pytest.mark.skipif(not REAL.exists(), reason="the real image with boxes is not here")
def test_real_boxes_survive_the_way_through_yolos_layout(tmp_path):
    with (REAL / "OSBS_029.csv").open() as file:
        rows = [[float(row[key]) for key in ("xmin", "ymin", "xmax", "ymax")] for row in csv.DictReader(file)]
    height, width, _ = cv2.imread(str(REAL / "OSBS_029.png")).shape
    size = np.array([width, height] * 2)
    held = labels.boxes([(0, *(np.array(row) / size)) for row in rows])
    labels.write(tmp_path, {"OSBS_029": held}, ("Tree",), images=False)
    found = read_dataset(tmp_path)
    assert len(found.images[0].truth) == 61
    np.testing.assert_allclose(found.images[0].truth.boxes * size, rows, atol=1e-9)
