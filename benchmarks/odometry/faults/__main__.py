"""The table of faults in Markdown: what was done, how far off the estimate was, what it said of itself.

    python -m benchmarks.odometry.faults --cache DIR [--cases wind dust ...]

Errors are against the simulator's truth; the poses before the fault are laid over it by heading and place, so that a
jump shows. "Outside" is the share of poses from the fault on whose error is beyond four stated sigmas.
"""

from __future__ import annotations

import argparse
from functools import cache
from pathlib import Path

from benchmarks.odometry.faults.catalogue import CASES, Case, cast
from benchmarks.odometry.faults.trial import Outcome, tried


def main() -> None:
    options = _options()
    walks = cache(lambda turning: cast(options.cache, turning=turning))
    print("| fault | worst, cm | end, cm | stated, cm | outside | no pose for, s | what was said, of how many scans |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in options.cases:
        print(_row(CASES[name], tried(CASES[name], walks(CASES[name].turning))), flush=True)


def _row(case: Case, outcome: Outcome) -> str:
    said = "; ".join(f"{note} ({count})" for note, count in outcome.notes.most_common())
    centimetres = (outcome.worst_m, outcome.end_m, outcome.end_sigma_m)
    figures = [*(f"{100.0 * value:.0f}" for value in centimetres), f"{outcome.outside:.0%}", f"{outcome.silent_s:.1f}"]
    return f"| {case.name} | {' | '.join(figures)} | {said or '-'} |"


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where cast walks are kept")
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=list(CASES), metavar="CASE")
    return parser.parse_args()


if __name__ == "__main__":
    main()
