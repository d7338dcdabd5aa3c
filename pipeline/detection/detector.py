"""The detector: an image in, what stands in it out."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.detection.card import Card, read_card
from pipeline.detection.decode import Found, decode, suppress
from pipeline.detection.errors import DetectionError, InferenceFailed, ModelForeign
from pipeline.detection.layout import BOX, Layout, find_layout
from pipeline.detection.letterbox import PAD, Fit, Letterbox, snug
from pipeline.detection.runtime import Device, Session, sha256
from pipeline.detections import FrameDetections

Image = npt.NDArray[np.uint8]
CONFIDENCE, IOU = 0.35, 0.5
OPEN_INPUT_PX = 832
_TYPES: dict[str, npt.DTypeLike] = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
_SLACK = 1e-3
"""Scores of half precision go so far past 0 and 1."""


@dataclass(frozen=True, slots=True)
class Settings:
    """confidence: least score; iou: boxes of a class that overlap by more are one; 0: what the model advises, else
    `CONFIDENCE` and `IOU`. most: boxes of an image.

    input_px: longer side of the input, where the model leaves it open. threads: 0 for as many as there are cores.
    cache: for what TensorRT builds.
    """

    confidence: float = 0.0
    iou: float = 0.0
    most: int = 300
    input_px: int = OPEN_INPUT_PX
    device: Device = "auto"
    threads: int = 0
    cache: Path | None = None


@dataclass(frozen=True, slots=True)
class ModelInfo:
    """What results are labelled with. device: that it runs on. input_px: height, width; None where it is open.

    advised: least score, of its maker, else `CONFIDENCE`.
    """

    name: str
    sha256: str
    class_names: tuple[str, ...]
    device: str
    layout: Layout
    input_px: tuple[int, int] | None
    demonstration: bool
    advised: float = CONFIDENCE

    @property
    def notice(self) -> str:
        """What has to be said before its results are used; empty where nothing has."""
        told = f"{self.name} is a model for demonstration only: what it says of real forests means nothing"
        return told if self.demonstration else ""


class Detector:
    """Loads in the thread that uses it: onnxruntime's own threads take that one's priority. Not thread-safe."""

    def __init__(self, path: Path, settings: Settings | None = None) -> None:
        """Loads, checks and runs the model once on grey. DetectionError says what is wrong with it."""
        self._settings = settings or Settings()
        digest = sha256(path)
        self._session = Session(path, self._settings.device, self._settings.threads, self._settings.cache)
        try:
            card = read_card(self._session.metadata)
            self._name, self._dtype, sides = _input(self._session.inputs)
            self._stride = card.stride
            self._input_px = _fixed(sides)
            self._longest_px = max(card.size_px) if card.size_px else self._settings.input_px
            self._box = Letterbox(self._input_px or _assumed(sides, self._longest_px), self._dtype)
            layout, classes = self._try_out(card)
        except (ModelForeign, InferenceFailed) as error:
            raise ModelForeign(f"{path}: {error}") from error
        names = card.names or tuple(f"class {index}" for index in range(classes))
        self.info = ModelInfo(
            path.stem,
            digest,
            names,
            self._session.device,
            layout,
            self._input_px,
            card.demonstration,
            card.confidence or CONFIDENCE,
        )
        self.confidence = self._settings.confidence or self.info.advised
        """Least score."""
        self.iou = self._settings.iou or card.iou or IOU
        """Boxes of a class that overlap by more are one."""

    def detect(self, image_bgr: Image, stamp_ns: int) -> FrameDetections:
        """image_bgr: (height, width, 3) uint8. InferenceFailed, DetectionError for what is no image."""
        if image_bgr.ndim != 3 or image_bgr.shape[2] != 3 or image_bgr.dtype != np.uint8 or not image_bgr.size:
            raise DetectionError(f"an image is uint8 of height x width x 3, not {image_bgr.dtype} {image_bgr.shape}")
        height, width, _ = image_bgr.shape
        box = self._letterbox((height, width))
        where = box.put(image_bgr)
        found = decode(self._run(box.blob), self.info.layout, self.confidence)
        if len(found.boxes):
            found = self._finished(found, where)
        return FrameDetections(
            stamp_ns, width, height, found.boxes, found.confidence, found.class_id, self.info.class_names
        )

    def _finished(self, found: Found, where: Fit) -> Found:
        """Each thing once, in pixels of the image."""
        if self.info.layout is not Layout.FINAL:
            found = suppress(found, self.iou, self._settings.most)
        found = _inside(Found(where.undo(found.boxes), found.confidence, found.class_id))
        names = len(self.info.class_names)
        if len(found.class_id) and not 0 <= found.class_id.min() <= found.class_id.max() < names:
            raise InferenceFailed(f"class {found.class_id.max()} of {names}: not in its names")
        return found

    def time_s(self, image_px: tuple[int, int], rounds: int = 3) -> float:
        """Least of some rounds on grey images of that height and width: what an image costs here. Also a warm-up."""
        grey = np.full((*image_px, 3), PAD, np.uint8)
        took = []
        for _ in range(rounds + 1):
            began_s = time.perf_counter()
            self.detect(grey, 0)
            took.append(time.perf_counter() - began_s)
        return min(took[1:])

    def _letterbox(self, image_px: tuple[int, int]) -> Letterbox:
        if self._input_px is None:
            wanted = snug(image_px, self._longest_px, self._stride)
            if wanted != self._box.blob.shape[2:]:
                self._box = Letterbox(wanted, self._dtype)
        return self._box

    def _run(self, blob: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        return self._session.run(self._name, blob)[0]

    def _try_out(self, card: Card) -> tuple[Layout, int]:
        """The shape an output really has: a file may leave it open."""
        if len(self._session.outputs) != 1:
            raise ModelForeign(f"it has the outputs {', '.join(self._session.outputs)}, expected one, as of YOLOv8")
        blob = self._box.blob
        output = self._run(blob)
        layout, classes = find_layout(output.shape, (blob.shape[2], blob.shape[3]), card)
        _refuse_raw(output, layout)
        return layout, classes


def _input(inputs: Sequence[Any]) -> tuple[str, npt.DTypeLike, tuple[int | None, int | None]]:
    """Name, type, and height and width, None where they are open."""
    if len(inputs) != 1:
        raise ModelForeign(f"it has the inputs {', '.join(i.name for i in inputs)}, expected one image")
    shape, kind = inputs[0].shape, inputs[0].type
    sides = [side if isinstance(side, int) and side > 0 else None for side in shape]
    if len(sides) != 4 or sides[0] not in (1, None) or sides[1] != 3 or kind not in _TYPES:
        told = " x ".join(str(side) for side in shape)
        raise ModelForeign(f"its input is {told} of {kind}, expected 1 x 3 x height x width of float or float16")
    return inputs[0].name, _TYPES[kind], (sides[2], sides[3])


def _fixed(sides: tuple[int | None, int | None]) -> tuple[int, int] | None:
    height, width = sides
    return (height, width) if height is not None and width is not None else None


def _assumed(sides: tuple[int | None, int | None], longest_px: int) -> tuple[int, int]:
    if any(sides):
        raise ModelForeign("its input has one side fixed and one open; export with both fixed, or both open")
    return longest_px, longest_px


def _refuse_raw(output: npt.NDArray[np.floating], layout: Layout) -> None:
    """Networks of the same shape that mean something else, such as YOLOX and YOLOv5, show by their numbers."""
    rows = output[0].T if layout is Layout.ROWS else output[0]
    final = layout is Layout.FINAL
    scores = rows[:, BOX] if final else rows[:, BOX:]
    sizes = rows[:, 2:BOX] - rows[:, :2] if final else rows[:, 2:BOX]
    if not np.isfinite(rows).all() or scores.min() < -_SLACK or scores.max() > 1.0 + _SLACK:
        raise ModelForeign("its scores are not between 0 and 1; export with the final sigmoid")
    if sizes.min() < 0.0 or (final and (rows[:, BOX + 1] % 1.0).any()):
        raise ModelForeign(f"its numbers are not those of {layout.value}; export a model of YOLOv8 or later")


def _inside(found: Found) -> Found:
    """Without boxes of which nothing is in the image."""
    size = found.boxes[:, 2:] - found.boxes[:, :2]
    return found.chosen(np.flatnonzero((size > 0.0).all(axis=1)))
