"""Figures of a detector against those of COCO's own tool, and against counting by hand."""

from __future__ import annotations

import contextlib
import io

import numpy as np
import pytest

from pipeline.evaluation.dataset import Dataset, LabelledImage, read_dataset
from pipeline.evaluation.detection import evaluate
from pipeline.evaluation.errors import DatasetError
from pipeline.evaluation.matching import IOUS, average_precision, gather
from pipeline.evaluation.predictions import read_predictions
from tests.pipeline.evaluation import labels

NAMES = ("ailanthus", "sumac")


def dataset(truth, sites=None, names=NAMES) -> Dataset:
    images = tuple(LabelledImage(n, None, (sites or {}).get(n, "here"), held) for n, held in truth.items())
    return Dataset(None, names, images, ())


def coco(truth, found, classes: int) -> np.ndarray:
    """(10,) mean over classes of the average precision at each IoU, by pycocotools."""
    module = pytest.importorskip("pycocotools.coco", reason="the oracle is a dependency of development")
    from pycocotools.cocoeval import COCOeval  # noqa: PLC0415

    true, guesses, ids = [], [], {name: k + 1 for k, name in enumerate(truth)}
    for name, held in truth.items():
        for (left, top, right, bottom), kind in zip(held.boxes * 1000, held.class_id, strict=True):
            box = [left, top, right - left, bottom - top]
            area = (right - left) * (bottom - top)
            true.append({"id": len(true) + 1, "image_id": ids[name], "category_id": int(kind) + 1, "bbox": box})
            true[-1] |= {"area": area, "iscrowd": 0}
        said = found[name]
        for corners, kind, sure in zip(said.boxes * 1000, said.class_id, said.confidence, strict=True):
            box = [*corners[:2], *(corners[2:] - corners[:2])]
            guesses.append({"image_id": ids[name], "category_id": int(kind) + 1, "bbox": box, "score": float(sure)})
    with contextlib.redirect_stdout(io.StringIO()):
        held = module.COCO()
        held.dataset = {
            "images": [{"id": k, "width": 1000, "height": 1000} for k in ids.values()],
            "categories": [{"id": k + 1, "name": str(k)} for k in range(classes)],
            "annotations": true,
        }
        held.createIndex()
        judge = COCOeval(held, held.loadRes(guesses), "bbox")
        judge.evaluate()
        judge.accumulate()
    precision = judge.eval["precision"][:, :, :, 0, 2]  # IoU, recall, class; all areas, 100 boxes
    return precision.mean(axis=(1, 2))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("classes", [1, 2])
def test_average_precision_is_cocos(seed, classes):
    truth, found = labels.random_case(seed, classes=classes)
    expected = coco(truth, found, classes)
    per_class = []
    for kind in range(classes):
        rows = [(found[n].boxes[found[n].class_id == kind], found[n].confidence[found[n].class_id == kind],
                 truth[n].boxes[truth[n].class_id == kind]) for n in truth]  # fmt: skip
        per_class.append(average_precision(gather(rows)))
    np.testing.assert_allclose(np.mean(per_class, axis=0), expected, atol=1e-12)
    report = evaluate(dataset(truth, names=NAMES[:classes]), found, NAMES[:classes], 0.35).report
    assert report.overall.ap50 == pytest.approx(expected[0], abs=1e-12)
    assert report.overall.ap50_95 == pytest.approx(expected.mean(), abs=1e-12)


def test_more_than_a_hundred_boxes_count_as_a_hundred():
    rng = np.random.default_rng(1)
    truth = {"a": labels.boxes([(0, 0.4, 0.4, 0.6, 0.6)])}
    wrong = [(0, 0.0, 0.0, 0.1, 0.1, round(0.5 + 0.4 * float(rng.random()), 3)) for _ in range(150)]
    found = {"a": labels.boxes([*wrong, (0, 0.4, 0.4, 0.6, 0.6, 0.45)])}
    assert coco(truth, found, 1)[0] == 0.0
    assert evaluate(dataset(truth, names=NAMES[:1]), found, NAMES[:1], 0.35).report.overall.ap50 == 0.0


TRUTH = {
    "one": labels.boxes([(0, 0.0, 0.0, 0.4, 0.4), (1, 0.5, 0.5, 0.9, 0.9)]),
    "two": labels.boxes([(0, 0.1, 0.1, 0.3, 0.3)]),
    "three": labels.boxes([]),
}
FOUND = {
    "one": labels.boxes(
        [
            (0, 0.01, 0.0, 0.4, 0.4, 0.9),  # right
            (0, 0.0, 0.01, 0.4, 0.4, 0.8),  # the same once more: wrong
            (0, 0.5, 0.5, 0.9, 0.9, 0.6),  # a sumac
            (0, 0.6, 0.0, 0.9, 0.2, 0.2),  # not sure enough
        ]
    ),
    "three": labels.boxes([(1, 0.2, 0.2, 0.4, 0.4, 0.7)]),  # out of nothing
}


def test_counts_at_the_operating_point_are_those_by_hand():
    report = evaluate(dataset(TRUTH), FOUND, NAMES, 0.35).report
    ailanthus, sumac = report.classes["ailanthus"], report.classes["sumac"]
    assert (ailanthus.truths, ailanthus.found, ailanthus.hits) == (2, 3, 1)
    assert (ailanthus.precision, ailanthus.recall, ailanthus.f1) == (pytest.approx(1 / 3), 0.5, pytest.approx(0.4))
    assert (sumac.truths, sumac.found, sumac.hits, sumac.precision, sumac.recall) == (1, 1, 0, 0.0, 0.0)
    assert (report.overall.truths, report.overall.found, report.overall.hits) == (3, 4, 1)
    assert report.confusion == ((1, 0, 1), (1, 0, 0), (1, 1, 0))
    lower = evaluate(dataset(TRUTH), FOUND, NAMES, 0.1).report
    assert lower.classes["ailanthus"].found == 4


def test_figures_by_site_and_the_worst_images_come_first():
    evaluated = evaluate(dataset(TRUTH, {"one": "trail", "two": "trail", "three": "meadow"}), FOUND, NAMES, 0.35)
    sites = evaluated.report.sites
    assert (sites["trail"].images, sites["trail"].truths, sites["trail"].found) == (2, 3, 3)
    assert (sites["meadow"].images, sites["meadow"].found, np.isnan(sites["meadow"].recall)) == (1, 1, True)
    names = [one.image.name for one in evaluated.worst]
    assert names == ["one", "two", "three"]
    worst = evaluated.worst[0]
    assert (worst.hits.tolist(), worst.missed.tolist()) == ([True, False, False], [False, True])
    assert worst.weight == pytest.approx(1 + 0.8 + 0.6)


def test_the_interval_is_wider_where_sites_differ_than_images_alone_would_tell():
    truth = {f"{k}": labels.boxes([(0, 0.1, 0.1, 0.3, 0.3)]) for k in range(60)}
    good = {name for k, name in enumerate(truth) if k % 6 < 3}  # of six sites, three are easy
    found = {name: truth[name] if name in good else labels.boxes([]) for name in truth}
    sites = {name: f"site {k % 6}" for k, name in enumerate(truth)}
    by_site = evaluate(dataset(truth, sites, NAMES[:1]), found, NAMES[:1], 0.35).report
    by_image = evaluate(dataset(truth, names=NAMES[:1]), found, NAMES[:1], 0.35).report
    assert (by_site.resampled, by_image.resampled) == ("sites", "images")
    assert by_site.overall.recall == by_image.overall.recall == 0.5
    wide, narrow = by_site.intervals["recall"], by_image.intervals["recall"]
    # Standard errors of a share of one half: 0.2 of six sites, 0.065 of sixty images.
    assert wide.high - wide.low == pytest.approx(2 * 1.96 * 0.5 / 6**0.5, rel=0.2)
    assert narrow.high - narrow.low == pytest.approx(2 * 1.96 * 0.5 / 60**0.5, rel=0.2)


def test_the_curve_ends_at_everything_that_was_found():
    evaluated = evaluate(dataset(TRUTH), FOUND, NAMES, 0.35)
    curve = evaluated.curves["ailanthus"]
    assert curve.confidence.tolist() == [0.9, 0.8, 0.6, 0.2]
    np.testing.assert_allclose(curve.precision, [1, 1 / 2, 1 / 3, 1 / 4])
    np.testing.assert_allclose(curve.recall, [0.5] * 4)


def test_classes_are_the_same_when_their_names_are():
    truth = {"a": labels.boxes([(1, 0.1, 0.1, 0.3, 0.3)])}
    found = {"a": labels.boxes([(2, 0.1, 0.1, 0.3, 0.3, 0.9), (0, 0.5, 0.5, 0.6, 0.6, 0.9)])}
    report = evaluate(dataset(truth), found, ("oak", "ailanthus", "SUMAC"), 0.35).report
    assert report.names == ("ailanthus", "sumac", "oak")
    assert (report.classes["sumac"].hits, report.classes["oak"].found) == (1, 1)
    assert report.notes == ("the dataset has no oak: every one that is found counts as wrong",)
    assert report.overall.ap50 == 1.0
    alone = evaluate(dataset({"a": labels.boxes([(0, 0.1, 0.1, 0.3, 0.3)])}, names=("ailanthus",)),
                     {"a": labels.boxes([(0, 0.1, 0.1, 0.3, 0.3, 0.9)])}, ("tree-of-heaven",), 0.35).report  # fmt: skip
    assert alone.classes["ailanthus"].hits == 1
    assert alone.notes == ("'tree-of-heaven' of the detector is taken as 'ailanthus'",)


def test_nothing_found_and_nothing_there_are_no_division_by_zero():
    report = evaluate(dataset({"a": labels.boxes([])}), {}, NAMES, 0.35).report
    assert np.isnan([report.overall.precision, report.overall.recall, report.overall.f1, report.overall.ap50]).all()
    assert report.intervals == {}
    missed = evaluate(dataset(TRUTH), {}, NAMES, 0.35).report.overall
    assert (missed.recall, missed.ap50, missed.f1) == (0.0, 0.0, 0.0)


def test_predictions_of_other_programs_are_read(tmp_path):
    truth, found = labels.random_case(3)
    held = read_dataset(labels.write(tmp_path / "data", truth, NAMES, images=False))
    folder = tmp_path / "runs"
    for name in found:
        (folder / "labels" / name).parent.mkdir(parents=True, exist_ok=True)
    for name, boxes in found.items():
        (folder / "labels" / f"{name}.txt").write_text(labels.text(boxes, sure=True))
    read, names = read_predictions(folder, held)
    assert names == NAMES
    one = evaluate(held, read, names, 0.35).report
    other = evaluate(dataset(truth), found, NAMES, 0.35).report
    assert one.overall == other.overall
    with pytest.raises(DatasetError, match=r"has no text of the name of an image, such as 000\.txt"):
        read_predictions(tmp_path / "data" / "classes.txt", held)


def test_every_iou_of_coco_is_there():
    np.testing.assert_allclose(IOUS, np.arange(0.5, 0.96, 0.05))
