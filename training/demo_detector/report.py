"""The scores as tables in Markdown."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

from drivers.sim.boxes import Annotation
from training.demo_detector.score import CONFIDENCE, Tally, score
from training.demo_detector.walks import held_out_walk

RANGES_M = (0.0, 5.0, 10.0, 15.0, 20.0)


def report(model: Path, walks: Iterable[Path]) -> str:
    """By scenario, by range, and what was mistaken for a tree."""
    by_scenario: defaultdict[str, Tally] = defaultdict(Tally)
    for walk in walks:
        by_scenario[held_out_walk(int(walk.name)).name] += score(model, walk, Annotation())
    total = sum(by_scenario.values(), Tally())
    return "\n\n".join([_scenarios(by_scenario, total), _ranges(total), _mistakes(total)])


def _scenarios(tallies: dict[str, Tally], total: Tally) -> str:
    lines = [
        "| scenario | images | trees | precision | recall | F1 | AP50 | well seen, found within 3 s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, one in (*tallies.items(), ("**all**", total)):
        rates = (one.precision, one.recall(), one.f1, one.ap50)
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


def _mistakes(total: Tally) -> str:
    lines = [f"| wrong at {CONFIDENCE}: what stands there | detections | per 100 images |", "|---|---|---|"]
    for name, count in total.mistaken_for.most_common():
        lines.append(f"| {name} | {count} | {100.0 * count / len(total.compared):.2f} |")
    return "\n".join(lines)
