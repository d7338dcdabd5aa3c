"""The scores as tables in Markdown."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

from drivers.sim.boxes import Annotation
from training.demo_detector.score import Tally, opened, score
from training.demo_detector.walks import held_out_walk

RANGES_M = (0.0, 5.0, 10.0, 15.0, 20.0)
CONFIDENCES = (0.5, 0.4, 0.35, 0.3, 0.25, 0.2, 0.15, 0.1)


def report(model: Path, walks: Iterable[Path]) -> str:
    """By scenario, range and confidence, and what was mistaken for a tree."""
    detector = opened(model)
    by_scenario: defaultdict[str, Tally] = defaultdict(Tally)
    for walk in walks:
        by_scenario[held_out_walk(int(walk.name)).name] += score(detector, walk, Annotation())
    total = sum(by_scenario.values(), Tally())
    at = f"Found is what has a confidence of {detector.info.advised:g}."
    tables = (_scenarios(by_scenario, total), _ranges(total), _confidences(total), _mistakes(total))
    return "\n\n".join([at, *tables])


def _scenarios(tallies: dict[str, Tally], total: Tally) -> str:
    lines = [
        "| scenario | images | trees | precision | recall | F1 | AP50 | AP50-95 | well seen, found within 3 s |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, one in (*tallies.items(), ("**all**", total)):
        rates = (one.precision, one.recall(), one.f1, *one.average_precision())
        seen = f"{one.windows_found} of {one.windows}"
        cells = (name, str(len(one.compared)), str(one.trees), *(f"{rate:.3f}" for rate in rates), seen)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _ranges(total: Tally) -> str:
    lines = ["| range | trees | recall |", "|---|---|---|"]
    for low, high in pairwise(RANGES_M):
        trees = sum(low <= m < high for m in (*total.found_m, *total.missed_m))
        lines.append(f"| {low:.0f}-{high:.0f} m | {trees} | {total.recall(low, high):.3f} |")
    return "\n".join(lines)


def _confidences(total: Tally) -> str:
    lines = ["| confidence | precision | recall | F1 |", "|---|---|---|---|"]
    curve = total.curve()
    for least in CONFIDENCES:
        count = int((curve.confidence >= least).sum())
        precision, recall = (curve.precision[count - 1], curve.recall[count - 1]) if count else (0.0, 0.0)
        f1 = 2.0 * precision * recall / max(precision + recall, 1e-9)
        lines.append(f"| {least:g} | {precision:.3f} | {recall:.3f} | {f1:.3f} |")
    return "\n".join(lines)


def _mistakes(total: Tally) -> str:
    lines = ["| wrong: what stands there | detections | per 100 images |", "|---|---|---|"]
    for name, count in total.mistaken_for.most_common():
        lines.append(f"| {name} | {count} | {100.0 * count / len(total.compared):.2f} |")
    return "\n".join(lines)
