"""The page and the picture of an evaluation, as a person and as a parser see them."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

from pipeline.evaluation.dataset import read_dataset
from pipeline.evaluation.detection import Evaluated, evaluate
from pipeline.products.contact_sheet import MOST, TILE_PX, write_contact_sheet
from pipeline.products.detection_page import write_detection_page
from tests.pipeline.evaluation import labels

NAMES = ("ailanthus <1>", "sumac")


def evaluated(folder, seed: int = 3, images: int = 12) -> Evaluated:
    truth, found = labels.random_case(seed, images)
    sites = {name: f"walk {k % 6}" for k, name in enumerate(truth)}
    return evaluate(read_dataset(labels.write(folder, truth, NAMES, sites)), found, NAMES, 0.35)


def test_every_figure_has_its_place_and_nothing_comes_from_elsewhere(tmp_path):
    one = evaluated(tmp_path / "data")
    write_detection_page(tmp_path / "page.html", "spot & co", one)
    text = (tmp_path / "page.html").read_text()
    assert not re.search("https?:|src=|href=|@import|<script|url\\(|nan", text)
    titles = re.findall("<h3>([^<]+)", text)
    assert titles == [
        "Precision over recall",
        "ailanthus &lt;1&gt;: what confidence to ask for",
        "sumac: what confidence to ask for",
        "By class",
        "By site",
        "What is taken for what",
    ]
    for svg in re.findall("<svg.*?</svg>", text, re.DOTALL):
        ElementTree.fromstring(svg)
    for table in re.findall("<table.*?</table>", text, re.DOTALL):
        ElementTree.fromstring(table)
    interval = one.report.intervals["recall"]
    assert f"{one.report.overall.recall:.3f} ({interval.low:.2f} to {interval.high:.2f})" in text
    assert f">{one.report.confusion[0][0]}<" in text


def test_an_evaluation_in_which_nothing_was_found_still_has_a_page(tmp_path):
    truth, _ = labels.random_case(1, 3)
    one = evaluate(read_dataset(labels.write(tmp_path / "data", truth, NAMES)), {}, NAMES, 0.35)
    write_detection_page(tmp_path / "page.html", "nothing", one)
    assert "Precision over recall" in (tmp_path / "page.html").read_text()


def colours(picture: np.ndarray) -> set[str]:
    """Which of the marks there are."""
    marks = {"right": (115, 158, 0), "missed": (0, 159, 230), "wrong": (80, 60, 214)}
    return {name for name, colour in marks.items() if (np.abs(picture.astype(int) - colour).max(axis=2) < 6).any()}


@pytest.mark.parametrize("ending", ["jpg", "png"])
def test_the_worst_images_are_on_one_picture_with_what_is_wrong_in_them(tmp_path, ending):
    one = evaluated(tmp_path / "data", images=20)
    path = tmp_path / f"worst.{ending}"
    assert write_contact_sheet(path, one.worst, NAMES) == min(MOST, len(one.worst)) == MOST
    picture = cv2.imread(str(path))
    assert picture.shape[0] > 4 * TILE_PX[0]
    assert picture.shape[1] > 3 * TILE_PX[1]
    if ending == "png":
        assert colours(picture) == {"right", "missed", "wrong"}


def test_a_perfect_detector_and_an_image_that_is_gone_are_no_trouble(tmp_path):
    one = evaluated(tmp_path / "data")
    write_contact_sheet(tmp_path / "none.png", (), NAMES)
    assert colours(cv2.imread(str(tmp_path / "none.png"))) == set()
    one.worst[0].image.path.unlink()
    assert write_contact_sheet(tmp_path / "gone.png", one.worst[:1], NAMES) == 1


def test_an_ending_that_no_picture_has_is_told(tmp_path):
    with pytest.raises(ValueError, match=r"pictures end in \.jpg or \.png"):
        write_contact_sheet(tmp_path / "worst.xyz", evaluated(tmp_path / "data").worst, NAMES)
