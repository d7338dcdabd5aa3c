"""What a detector says of the images of a dataset: asked here, or read from a folder that another program left."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import cv2
import numpy as np

from pipeline.detection.detector import Detector
from pipeline.detections import FrameDetections
from pipeline.evaluation.dataset import Boxes, Dataset, read_boxes, read_classes
from pipeline.evaluation.errors import DatasetError

UNSURE = 0.001
"""Least confidence for the curves and average precisions."""


def predict(dataset: Dataset, detector: Detector, advance: Callable[[float], None]) -> dict[str, Boxes]:
    """By name of the image. advance: told the share that is done. DatasetError for an image that cannot be read."""
    found = {}
    for number, image in enumerate(dataset.images):
        if image.path is None:
            raise DatasetError(f"{dataset.folder}: has no images/, and a detector needs some; give predictions instead")
        pixels = cv2.imread(str(image.path), cv2.IMREAD_COLOR)
        if pixels is None:
            raise DatasetError(f"{image.path}: not an image that can be read; export it again")
        found[image.name] = _boxes(detector.detect(np.asarray(pixels, np.uint8), 0))
        advance((number + 1) / len(dataset.images))
    return found


def read_predictions(folder: Path, dataset: Dataset) -> tuple[dict[str, Boxes], tuple[str, ...]]:
    """Texts with `class cx cy w h confidence`, and the names of the classes: of its classes.txt, else the dataset's.

    DatasetError names file and line.
    """
    names = read_classes(folder / "classes.txt") if (folder / "classes.txt").exists() else dataset.class_names
    inner = folder / "labels"
    place = inner if inner.is_dir() else folder
    paths = {image.name: place / f"{image.name}.txt" for image in dataset.images}
    there: Mapping[str, Path] = {name: path for name, path in paths.items() if path.exists()}
    if not there:
        raise DatasetError(f"{place}: has no text of the name of an image, such as {next(iter(paths.values())).name}")
    return {name: read_boxes(path, len(names), predicted=True) for name, path in there.items()}, names


def _boxes(found: FrameDetections) -> Boxes:
    size = np.array([found.width_px, found.height_px] * 2)
    return Boxes(found.boxes_px / size, found.class_id, found.confidence)
