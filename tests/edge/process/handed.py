"""A recording, processed with a fake odometry, and a stand of trees handed out beside it."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from edge.config import Config, Products
from edge.process.process import Task, process
from edge.process.products_stage import ProductsStage
from pipeline.products.findings import PointEvidence
from tests.edge.process.test_process import fakes
from tests.pipeline.products import stand


def hot(_tile, points):
    seen = np.ones(len(points), np.uint16)
    return PointEvidence(np.full(len(points), 0.25, np.float32), np.zeros(len(points), np.uint8), seen)


def found(folder, frame="map"):
    folder.mkdir()
    given = stand.findings(folder, evidence=hot)
    return replace(given, frame=frame, trees=[replace(tree, frame=frame) for tree in given.trees])


def hand_out(recording, findings, *, gnss=True, **settings):
    done = process(Task([recording], gnss=gnss), Config(), load=fakes())
    config = msgspec.structs.replace(Products(), **settings)
    stage = ProductsStage(done.folder / "work", done.folder, config, "walk", "mapforest", findings)
    return done.folder, stage.run(lambda _: None)
