"""A few trees and what was seen around them, for the tests of everything that is handed out."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.products.coverage import CoverageGrid
from pipeline.products.earth import Site
from pipeline.products.findings import Findings, Model
from pipeline.products.geoid import constant_geoid
from pipeline.products.occurrences import Survey
from pipeline.trees import Tree, View

START_NS = 1_790_000_000_123_456_789
DATUM = (40.057, -75.218, 60.0)
SITE = Site(DATUM)
MODEL = Model("toh-yolo", "ab" * 32)


def tree(number: int, east: float, north: float, **other) -> Tree:
    stamp = START_NS + number * 10**9
    told = {
        "class_name": "tree-of-heaven",
        "frame": "map",
        "position_m": np.array([east, north, -1.5]),
        "covariance": np.diag([0.04, 0.09, 0.01]),
        "probability": 0.93,
        "views": 12,
        "hits": 9,
        "points": 800,
        "stem_seen": True,
        "height_m": 14.2,
        "crown_m": 4.0,
        "first_ns": stamp,
        "last_ns": stamp + 5 * 10**9,
        "best": (View(stamp, (10.0, 20.0, 200.0, 400.0), 0.88, 7.5),),
    }
    return Tree(tree_id=number, **{**told, **other})


def trees() -> list[Tree]:
    lonely = tree(7, 40.0, -20.0, stem_seen=False, crown_m=np.nan, height_m=np.nan, probability=0.51)
    return [tree(1, 5.0, 3.0), tree(2, 9.0, 4.0, class_name="Ailanthus_altissima"), lonely]


def coverage(cell_m: float = 0.5) -> CoverageGrid:
    """A square of 60 m by 40 m around the way, seen twice; the eastern half of it once more; evidence at the trees."""
    grid = CoverageGrid(cell_m)
    x, y = np.meshgrid(np.arange(-10, 50, cell_m) + cell_m / 2, np.arange(-25, 15, cell_m) + cell_m / 2)
    everything = np.column_stack([x.ravel(), y.ravel()])
    for sigma in (0.4, 0.2):
        grid.see(everything, sigma)
    grid.see(everything[everything[:, 0] > 20], 0.9)
    grid.weigh(everything, np.full(len(everything), -4.0))
    for one in trees():
        near = np.linalg.norm(everything - one.position_m[:2], axis=1) < 1.5
        grid.weigh(everything[near], np.full(int(near.sum()), 3.0))
    return grid


def chip(path, seed: int = 0):
    picture = np.random.default_rng(seed).integers(0, 255, (600, 400, 3), np.uint8)
    assert cv2.imwrite(str(path), picture)
    return path


def findings(folder=None, **other) -> Findings:
    chips = {1: chip(folder / "1.jpg", 1), 7: chip(folder / "7.jpg", 7)} if folder is not None else {}
    return Findings("map", trees(), MODEL, 1200, coverage(), chips, **other)


def survey(site: Site | None = SITE) -> Survey:
    east = np.linspace(0.0, 40.0, 81)
    way = np.column_stack([east, np.zeros(81), np.zeros(81)])
    stamps = START_NS + np.arange(81) * 10**8
    return Survey("20260921T142640Z_walk", "A. Walker", "Parks", stamps, way, site, constant_geoid(-33.5))
