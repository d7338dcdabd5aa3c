"""The real pairs: field stems under an airborne scan, and a mobile scan under an airborne one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.alignment.peer_trials import clique, peers
from benchmarks.alignment.trials import Asked, Case, Trial, ours, push_cloud, push_stems, pushes
from pipeline.alignment.cloud import inspect
from pipeline.alignment.stem_table import read_stems

SAME_OUTLINE = 0.7
"""Overlap asked for at Fort Valley: both clips have one outline, and a turn alone takes the corners off it."""


def chablais(asked: Asked) -> Iterator[Trial]:
    """50 x 50 m, 110 stems."""
    yield from _stems(asked, "chablais3", asked.data / "chablais3_trees.csv")


def patches(asked: Asked) -> Iterator[Trial]:
    """Three, as published: the two halves of `chablais3`, 50 x 26 m with 55 stems, and Fort Valley."""
    table = asked.data / "chablais3_trees.csv"
    y = read_stems(table).places_m[:, 1]
    head, *rows = table.read_text(encoding="utf-8").splitlines()
    for name, inside in (("south", y < np.mean([y.min(), y.max()])), ("north", y >= np.mean([y.min(), y.max()]))):
        half = asked.folder / f"{name}.csv"
        half.write_text("\n".join([head, *(row for row, kept in zip(rows, inside, strict=True) if kept)]) + "\n")
        yield from _stems(asked, f"chablais3, {name}ern half", half)
    yield from fort_valley(asked)


def _stems(asked: Asked, pair: str, stems: Path) -> Iterator[Trial]:
    """Of `chablais3`, under its airborne scan."""
    aerial, places = asked.data / "chablais3_als.laz", read_stems(stems).places_m
    trues = list(pushes((places.min(axis=0) + places.max(axis=0)) / 2, asked.first, asked.count))
    for true in trues:
        ground = push_stems(stems, asked.folder / "stems.csv", true)
        yield from each(asked, Case(pair, aerial, ground, true))
    yield from peers(asked, pair, aerial, stems, trues)


def fort_valley(asked: Asked) -> Iterator[Trial]:
    """28 x 29 m."""
    aerial, ground = asked.data / "fort_valley_als.laz", asked.data / "fort_valley_mls.laz"
    cloud = inspect(ground)
    trues = list(pushes(np.asarray((cloud.low_m + cloud.high_m)[:2] / 2), asked.first, asked.count))
    for true in trues:
        pushed = push_cloud(ground, asked.folder / "ground.laz", true)
        yield from each(asked, Case("Fort Valley", aerial, pushed, true, SAME_OUTLINE))
    yield from peers(asked, "Fort Valley", aerial, ground, trues)


def each(asked: Asked, case: Case) -> Iterator[Trial]:
    """The methods that were asked for, on one case."""
    for method in asked.methods:
        yield clique(case) if method == "clique" else ours(method, case)
