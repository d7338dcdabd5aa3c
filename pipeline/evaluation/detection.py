"""How well a detector does on labelled images: at its operating point, at every confidence, by site, and with what it
confuses things."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
import numpy.typing as npt

from pipeline.evaluation.dataset import Boxes, Dataset, LabelledImage
from pipeline.evaluation.matching import IOUS, Curve, Matches, average_precision, curve, gather, match, overlaps

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
BACKGROUND = "nothing"
RESAMPLES = 1000
FEWEST_SITES = 5
"""Of which an interval can be told; with fewer, images are drawn, and what they share makes it too narrow."""
_SEED = 20260101


class Interval(msgspec.Struct, frozen=True):
    """95 % of the resamples."""

    low: float
    high: float


class Figures(msgspec.Struct, frozen=True):
    """At the operating point, but for the average precisions. NaN where there is nothing to divide by."""

    images: int
    truths: int
    found: int
    hits: int
    precision: float
    recall: float
    f1: float
    ap50: float
    ap50_95: float


class DetectionReport(msgspec.Struct, frozen=True):
    """overall: everything of all classes together, average precisions as the mean of the classes with truths.

    confusion: rows what is there, columns what was said; the last of each is nothing. intervals: of overall.
    """

    confidence: float
    iou: float
    overall: Figures
    intervals: dict[str, Interval]
    resampled: str
    """What was drawn for the intervals: sites or images."""
    classes: dict[str, Figures]
    sites: dict[str, Figures]
    names: tuple[str, ...]
    confusion: tuple[tuple[int, ...], ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class ImageErrors:
    """Of one image at the operating point. found: only those sure enough; hits: (k,) which of them are true; missed:
    (m,) which truths nobody found."""

    image: LabelledImage
    found: Boxes
    hits: npt.NDArray[np.bool_]
    missed: npt.NDArray[np.bool_]

    @property
    def weight(self) -> float:
        """How bad it is: each missed one, and each wrong one by how sure it was."""
        return float(self.missed.sum()) + float(self.found.confidence[~self.hits].sum())


@dataclass(frozen=True, slots=True, eq=False)
class Evaluated:
    """The report, with what plots and pictures need. curves: by class.

    worst: every image with an error, worst first.
    """

    report: DetectionReport
    curves: dict[str, Curve]
    worst: tuple[ImageErrors, ...]


def evaluate(dataset: Dataset, found: Mapping[str, Boxes], found_names: Sequence[str], confidence: float) -> Evaluated:
    """found: by name of the image, with classes of `found_names`. confidence: of the operating point.

    Classes are the same when their names are, but for capitals; when both sides have one only, it is the same.
    """
    names, renumbered, notes = _together(dataset.class_names, found_names)
    nothing = Boxes(np.empty((0, 4)), np.empty(0, np.int64), np.empty(0))
    pairs = [(image, _renumbered(found.get(image.name, nothing), renumbered)) for image in dataset.images]
    matches = [_matches(pairs, number) for number in range(len(names))]
    everywhere = np.ones(len(pairs), np.int64)
    sites = {site: _of_site(dataset, site) for site in dataset.sites}
    intervals, resampled = _intervals(matches, list(sites.values()), confidence)
    report = DetectionReport(
        confidence=confidence,
        iou=float(IOUS[0]),
        overall=_figures(matches, everywhere, confidence),
        intervals=intervals,
        resampled=resampled,
        classes={name: _figures([one], everywhere, confidence) for name, one in zip(names, matches, strict=True)},
        sites={site: _figures(matches, counts, confidence) for site, counts in sites.items()},
        names=names,
        confusion=_confusion(pairs, len(names), confidence),
        notes=(*dataset.notes, *notes),
    )
    errors = [_errors(image, boxes, confidence) for image, boxes in pairs]
    worst = sorted((one for one in errors if one.weight > 0), key=lambda one: -one.weight)
    return Evaluated(report, {n: curve(m) for n, m in zip(names, matches, strict=True)}, tuple(worst))


def _together(true: Sequence[str], found: Sequence[str]) -> tuple[tuple[str, ...], Counts, list[str]]:
    """All names, the number among them of each found class, and what has to be said."""
    if len(true) == len(found) == 1 and true[0].casefold() != found[0].casefold():
        return tuple(true), np.zeros(1, np.int64), [f"{found[0]!r} of the detector is taken as {true[0]!r}"]
    known = {name.casefold(): number for number, name in enumerate(true)}
    names, numbers = list(true), []
    for name in found:
        if name.casefold() not in known:
            known[name.casefold()] = len(names)
            names.append(name)
        numbers.append(known[name.casefold()])
    strange = names[len(true) :]
    said = [f"the dataset has no {', '.join(strange)}: every one that is found counts as wrong"] if strange else []
    return tuple(names), np.array(numbers, np.int64), said


def _renumbered(boxes: Boxes, numbers: Counts) -> Boxes:
    return Boxes(boxes.boxes, numbers[boxes.class_id], boxes.confidence) if len(boxes) else boxes


def _matches(pairs: Sequence[tuple[LabelledImage, Boxes]], number: int) -> Matches:
    per_image = []
    for image, boxes in pairs:
        mine, true = boxes.class_id == number, image.truth.class_id == number
        per_image.append((boxes.boxes[mine], boxes.confidence[mine], image.truth.boxes[true]))
    return gather(per_image)


def _of_site(dataset: Dataset, site: str) -> Counts:
    return np.array([image.site == site for image in dataset.images], np.int64)


def _figures(matches: Sequence[Matches], counts: Counts, confidence: float) -> Figures:
    """counts: (n,) how often each image counts."""
    truths, found, hits = _tally(matches, counts, confidence)
    precision, recall, f1 = _ratios(truths, found, hits)
    each = np.array([average_precision(one, counts) for one in matches])
    known = each[~np.isnan(each[:, 0])]
    ap50, ap50_95 = (float(known[:, 0].mean()), float(known.mean())) if len(known) else (float("nan"),) * 2
    return Figures(int(counts.sum()), truths, found, hits, precision, recall, f1, ap50, ap50_95)


def _tally(matches: Sequence[Matches], counts: Counts, confidence: float) -> tuple[int, int, int]:
    """Truths, boxes found, and true ones of these."""
    truths = found = hits = 0
    for one in matches:
        weight = counts[one.image] * (one.confidence >= confidence)
        truths += int(counts @ one.truths)
        found += int(weight.sum())
        hits += int(weight @ one.hit[0])
    return truths, found, hits


def _ratios(truths: int, found: int, hits: int) -> tuple[float, float, float]:
    """Precision, recall, F1."""
    nan = float("nan")
    f1 = 2 * hits / (truths + found) if truths + found else nan
    return (hits / found if found else nan), (hits / truths if truths else nan), f1


def _intervals(
    matches: Sequence[Matches], sites: Sequence[Counts], confidence: float
) -> tuple[dict[str, Interval], str]:
    """Percentiles of a bootstrap over sites: images of one place resemble each other."""
    images = len(sites[0])
    enough = len(sites) >= FEWEST_SITES
    units = np.array(sites) if enough else np.eye(images, dtype=np.int64)
    rng = np.random.default_rng(_SEED)
    drawn = rng.multinomial(len(units), np.full(len(units), 1 / len(units)), RESAMPLES) @ units
    rows = []
    for counts in drawn:
        each = [average_precision(one, counts, levels=1)[0] for one in matches]
        known = [value for value in each if not np.isnan(value)]
        rows.append((*_ratios(*_tally(matches, counts, confidence)), np.mean(known) if known else np.nan))
    found = {}
    for name, values in zip(("precision", "recall", "f1", "ap50"), np.array(rows).T, strict=True):
        if not np.isnan(values).all():
            low, high = np.nanpercentile(values, [2.5, 97.5])
            found[name] = Interval(float(low), float(high))
    return found, "sites" if enough else "images"


def _confusion(
    pairs: Sequence[tuple[LabelledImage, Boxes]], classes: int, confidence: float
) -> tuple[tuple[int, ...], ...]:
    """Boxes are matched by where they are, whatever they are said to be."""
    table = np.zeros((classes + 1, classes + 1), np.int64)
    for image, boxes in pairs:
        sure = np.flatnonzero(boxes.confidence >= confidence)
        sure = sure[np.argsort(-boxes.confidence[sure], kind="stable")]
        taken = match(overlaps(boxes.boxes[sure], image.truth.boxes), IOUS[0])
        there = np.append(image.truth.class_id, classes)
        np.add.at(table, (there[taken], boxes.class_id[sure]), 1)
        missed = np.setdiff1d(np.arange(len(image.truth)), taken)
        np.add.at(table[:, classes], image.truth.class_id[missed], 1)
    return tuple(tuple(row) for row in table.tolist())


def _errors(image: LabelledImage, boxes: Boxes, confidence: float) -> ImageErrors:
    """Class by class, as the figures count."""
    sure = boxes.confidence >= confidence
    kept = Boxes(boxes.boxes[sure], boxes.class_id[sure], boxes.confidence[sure])
    hits, missed = np.zeros(len(kept), bool), np.ones(len(image.truth), bool)
    for number in np.unique(kept.class_id):
        mine, true = np.flatnonzero(kept.class_id == number), np.flatnonzero(image.truth.class_id == number)
        mine = mine[np.argsort(-kept.confidence[mine], kind="stable")]
        taken = match(overlaps(kept.boxes[mine], image.truth.boxes[true]), IOUS[0])
        hits[mine] = taken >= 0
        missed[true[taken[taken >= 0]]] = False
    return ImageErrors(image, kept, hits, missed)
