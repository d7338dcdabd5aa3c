"""One page about how well a detector does on labelled images, readable offline."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isnan
from pathlib import Path

import numpy as np

from pipeline.evaluation.detection import BACKGROUND, DetectionReport, Evaluated, Figures
from pipeline.evaluation.matching import Curve
from pipeline.products import sheet
from pipeline.products.plots import Dots, Line, Plot

COLUMNS = ("images", "there", "found", "right", "precision", "recall", "F1", "AP50", "AP50-95")
_TONES = "abc"
_FRAME = Dots(np.array([0.0, 1.0]), np.array([0.0, 1.0]), "", "")
"""Not drawn; axes from 0 to 1."""


def write_detection_page(path: Path, title: str, evaluated: Evaluated) -> None:
    """Everything of the report, and the curves."""
    path.write_text(sheet.sheet(title, list(_parts(evaluated))), encoding="utf-8")


def row(figures: Figures) -> list[str]:
    """Under COLUMNS."""
    counts = (figures.images, figures.truths, figures.found, figures.hits)
    shares = (figures.precision, figures.recall, figures.f1, figures.ap50, figures.ap50_95)
    return [f"{count:,}" for count in counts] + [share(value) for value in shares]


def share(value: float) -> str:
    """Of 1."""
    return "-" if isnan(value) else f"{value:.3f}"


def _parts(evaluated: Evaluated) -> Iterator[str]:
    report = evaluated.report
    yield sheet.words(
        f"A box is right when it overlaps a true one of its class by at least {report.iou:g} of their union, each true "
        f"one once. Precision, recall and F1 are with boxes of confidence {report.confidence:g} or more; average "
        "precisions are over all confidences, interpolated at 101 recalls as COCO does."
    )
    yield sheet.facts(_facts(report))
    curves = {name: curve for name, curve in evaluated.curves.items() if report.classes[name].truths}
    told = f"The dots are at confidence {report.confidence:g}."
    yield sheet.figure("Precision over recall", _precision_recall(curves, report), told)
    for name, curve in curves.items():
        if len(curve.confidence):
            yield sheet.figure(f"{name}: what confidence to ask for", _over_confidence(curve))
    yield _table("By class", "class", report.classes)
    if len(report.sites) > 1:
        yield _table("By site", "site", report.sites)
    yield _confusion(report)
    if report.notes:
        yield sheet.notes(report.notes)


def _facts(report: DetectionReport) -> dict[str, str]:
    overall = report.overall
    values = {"precision": overall.precision, "recall": overall.recall, "f1": overall.f1, "ap50": overall.ap50}
    shown = {"images": f"{overall.images:,}", "there": f"{overall.truths:,}", "found": f"{overall.found:,}"}
    for name, value in values.items():
        interval = report.intervals.get(name)
        around = f" ({interval.low:.2f} to {interval.high:.2f})" if interval else ""
        shown[name.upper() if len(name) < 5 else name] = share(value) + around
    shown["AP50-95"] = share(overall.ap50_95)
    return shown | {"in brackets": f"95 %, {report.resampled} drawn anew"}


def _precision_recall(curves: Mapping[str, Curve], report: DetectionReport) -> Plot:
    lines, dots = [], [_FRAME]
    for index, (name, curve) in enumerate(curves.items()):
        tone = _TONES[index % len(_TONES)]
        lines.append(Line(curve.recall, curve.precision, name, tone))
        figures = report.classes[name]
        if figures.found:
            dots.append(Dots(np.array([figures.recall]), np.array([figures.precision]), "", tone))
    return Plot("recall", "precision", lines, dots, height=320, from_zero=True)


def _over_confidence(curve: Curve) -> Plot:
    total = curve.precision + curve.recall
    f1 = 2 * np.divide(curve.precision * curve.recall, total, out=np.zeros_like(total), where=total > 0)
    drawn = (("precision", curve.precision, "a"), ("recall", curve.recall, "c"), ("F1", f1, "b"))
    lines = [Line(curve.confidence[::-1], values[::-1], name, tone) for name, values, tone in drawn]
    return Plot("confidence", "share", lines, [_FRAME], from_zero=True)


def _table(title: str, what: str, rows: Mapping[str, Figures]) -> str:
    return sheet.figures(title, (what, *COLUMNS), [[name, *row(figures)] for name, figures in rows.items()])


def _confusion(report: DetectionReport) -> str:
    names = (*report.names, BACKGROUND)
    rows = [[name, *map(str, counts)] for name, counts in zip(names, report.confusion, strict=True)]
    caption = "Rows: what is there. Columns: what was said of it. Boxes are matched by where they are."
    return sheet.figures("What is taken for what", ("", *names), rows, caption)
