"""Examples as batches for training: shrunk as at run time, then changed at random."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from drivers.sim.boxes import Annotation
from pipeline.detection.letterbox import PAD, fit
from training.demo_detector.dataset import Picture

LEAST_LEFT = 0.3
"""Share of a box that a crop must leave for it to count."""
SEES_NOTHING_PX = 20
"""A few stray pixels of a leaf are not even worth being left open."""
Corners = npt.NDArray[np.float32]
Image = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Small:
    """An example at the scale of the network's input: image RGB (h, w, 3), boxes in its pixels."""

    image: Image
    wanted: Corners
    left_open: Corners


@dataclass(frozen=True, eq=False)
class Batch:
    """images (b, 3, h, w) RGB 0..1; wanted, left_open: for each image (n, 4) corners in pixels of the input."""

    images: Tensor
    wanted: list[Tensor]
    left_open: list[Tensor]


def shrunk(picture: Picture, rule: Annotation, input_px: tuple[int, int]) -> Small:
    """Read from disk and resized, as the letterbox at run time does it, without the grey around."""
    image = cv2.cvtColor(cv2.imread(str(picture.path)), cv2.COLOR_BGR2RGB)
    image_px = (image.shape[0], image.shape[1])
    height, width = fit(image_px, input_px).inner_px
    factor = np.array([width / image_px[1], height / image_px[0]] * 2, np.float32)
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR)
    counts, boxes = rule.counts(picture.boxes), picture.boxes.boxes_px.astype(np.float32) * factor
    return Small(small, boxes[counts], boxes[~counts & (picture.boxes.visible_px >= SEES_NOTHING_PX)])


def batches(
    examples: Sequence[Small], input_px: tuple[int, int], size: int, rng: np.random.Generator
) -> Iterator[Batch]:
    """One pass over all examples in random order, changed at random; the next batch is made while one is used."""
    order = rng.permutation(len(examples))
    chosen = [order[k : k + size] for k in range(0, len(order) - size + 1, size)]
    seeds = rng.integers(0, 2**32, len(chosen))

    def make(rows: npt.NDArray[np.intp], seed: int) -> Batch:
        own = np.random.default_rng(seed)
        return _stacked([_changed(examples[row], input_px, own) for row in rows])

    with ThreadPoolExecutor(1) as maker:
        ahead = maker.submit(make, chosen[0], seeds[0])
        for k in range(len(chosen)):
            batch = ahead.result()
            if k + 1 < len(chosen):
                ahead = maker.submit(make, chosen[k + 1], seeds[k + 1])
            yield batch


def _stacked(parts: list[Small]) -> Batch:
    images = torch.from_numpy(np.stack([part.image for part in parts])).permute(0, 3, 1, 2).float() / 255.0
    wanted = [torch.from_numpy(part.wanted) for part in parts]
    return Batch(images, wanted, [torch.from_numpy(part.left_open) for part in parts])


def _changed(small: Small, input_px: tuple[int, int], rng: np.random.Generator) -> Small:
    """Mirrored, moved and scaled, in another light."""
    warp = _warp(small.image.shape[:2], input_px, rng)
    size = (input_px[1], input_px[0])
    moved = cv2.warpAffine(small.image, warp, size, flags=cv2.INTER_LINEAR, borderValue=(PAD, PAD, PAD))
    wanted, rest = _cut(_moved(small.wanted, warp), input_px)
    left_open = np.concatenate([_cut(_moved(small.left_open, warp), input_px)[0], rest])
    return Small(_lit(moved, rng), wanted, left_open)


def _warp(image_px: tuple[int, int], input_px: tuple[int, int], rng: np.random.Generator) -> npt.NDArray[np.float64]:
    """(2, 3) from the image to the input: about in its middle, mirrored every other time."""
    (height, width), (rows, columns) = image_px, input_px
    scale = np.exp(rng.uniform(-0.25, 0.35))
    across = -scale if rng.random() < 0.5 else scale
    shift = rng.uniform(-0.15, 0.15, 2) * (columns, rows)
    middle = 0.5 * np.array([columns, rows]) + shift
    return np.array([[across, 0.0, middle[0] - across * width / 2], [0.0, scale, middle[1] - scale * height / 2]])


def _moved(boxes: Corners, warp: npt.NDArray[np.float64]) -> Corners:
    ends = boxes.reshape(-1, 2, 2) * np.diag(warp) + warp[:, 2]
    return np.concatenate([ends.min(axis=1), ends.max(axis=1)], axis=1).astype(np.float32)


def _cut(boxes: Corners, input_px: tuple[int, int]) -> tuple[Corners, Corners]:
    """What the picture's edge leaves of the boxes: enough to count, or too little."""
    edge = np.array([input_px[1], input_px[0]] * 2, np.float32)
    cut = np.clip(boxes, 0.0, edge)
    left = np.prod(cut[:, 2:] - cut[:, :2], axis=1) / np.maximum(np.prod(boxes[:, 2:] - boxes[:, :2], axis=1), 1e-6)
    return cut[left >= LEAST_LEFT], cut[(left < LEAST_LEFT) & (left > 0.0)]


def _lit(image: Image, rng: np.random.Generator) -> Image:
    """Another exposure, contrast, white balance and saturation."""
    gain = np.exp(rng.normal(0.0, 0.18)) * np.exp(rng.normal(0.0, 0.05, 3))
    table = np.linspace(0.0, 1.0, 256)[:, None] ** np.exp(rng.normal(0.0, 0.15)) * gain
    lit = cv2.LUT(image, np.clip(255.0 * table, 0, 255).astype(np.uint8)[None])
    grey = cv2.cvtColor(cv2.cvtColor(lit, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)
    colour = np.exp(rng.normal(0.0, 0.2))
    return cv2.addWeighted(lit, colour, grey, 1.0 - colour, 0.0)
