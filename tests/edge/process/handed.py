"""A recording, processed with a fake odometry, and a stand of trees handed out beside it."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from edge.config import Config, Products
from edge.process import detections_file, trees_file
from edge.process.detections_file import DetectionFacts, ModelFacts, write_detections
from edge.process.places import Places
from edge.process.process import Task, process
from edge.process.products_stage import ProductsStage
from edge.process.trees_file import GroundingFacts
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


def looked(work, findings):
    """As if a detector had."""
    (work / "detection").mkdir(exist_ok=True)
    (work / "grounding").mkdir(exist_ok=True)
    model = ModelFacts(findings.model.name, findings.model.sha256, ("ailanthus",), "cpu", 0.35, 0.5)
    write_detections(work / "detection" / detections_file.DETECTIONS, model, "/cam", [])
    told = msgspec.json.encode(DetectionFacts(model, findings.images))
    (work / "detection" / detections_file.FACTS).write_bytes(told)
    (work / "grounding" / trees_file.FACTS).write_bytes(msgspec.json.encode(GroundingFacts()))


def hand_out(recording, findings, *, gnss=True, **settings):
    done = process(Task([recording], gnss=gnss), Config(), load=fakes())
    config = msgspec.structs.replace(Products(), **settings)
    looked(done.folder / "work", findings)
    stage = ProductsStage(Places.of(done.folder / "work"), done.folder, config, "walk", "mapforest", findings)
    return done.folder, stage.run(lambda _: None)
