"""Datasets and predictions in YOLO's layout, for tests."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from pipeline.evaluation.dataset import Boxes

SIZE_PX = (60, 100)


def boxes(rows: Iterable[tuple[float, ...]]) -> Boxes:
    """Rows of class, x_min, y_min, x_max, y_max, confidence; the last may be left out."""
    held = np.array([(*row, 1.0)[:6] for row in rows], np.float64).reshape(-1, 6)
    return Boxes(held[:, 1:5], held[:, 0].astype(np.int64), held[:, 5])


def text(held: Boxes, *, sure: bool) -> str:
    """As YOLO writes it."""
    lines = []
    for (left, top, right, bottom), number, confidence in zip(held.boxes, held.class_id, held.confidence, strict=True):
        line = f"{number} {(left + right) / 2!r} {(top + bottom) / 2!r} {right - left!r} {bottom - top!r}"
        lines.append(line.replace("np.float64(", "").replace(")", "") + (f" {confidence}" if sure else ""))
    return "\n".join(lines)


def write(
    folder: Path, truth: dict[str, Boxes], names=("ailanthus",), sites: dict[str, str] | None = None, images=True
) -> Path:
    """A dataset."""
    for name, held in truth.items():
        label = folder / "labels" / f"{name}.txt"
        label.parent.mkdir(parents=True, exist_ok=True)
        label.write_text(text(held, sure=False))
        if images:
            image = folder / "images" / f"{name}.png"
            image.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(image), np.full((*SIZE_PX, 3), 90, np.uint8))
    (folder / "classes.txt").write_text("\n".join(names) + "\n")
    if sites is not None:
        (folder / "sites.csv").write_text("image,site\n" + "\n".join(f"{k},{v}" for k, v in sites.items()))
    return folder


def write_predictions(folder: Path, found: dict[str, Boxes], names: tuple[str, ...] = ()) -> Path:
    """As another program leaves them: nothing where nothing was found."""
    (folder / "labels").mkdir(parents=True)
    for name, held in found.items():
        if len(held):
            (folder / "labels" / f"{name}.txt").write_text(text(held, sure=True))
    if names:
        (folder / "classes.txt").write_text("\n".join(names))
    return folder


def random_case(seed: int, images: int = 12, classes: int = 2) -> tuple[dict[str, Boxes], dict[str, Boxes]]:
    """Truths, and predictions that hit some, shift others, repeat, and invent."""
    rng = np.random.default_rng(seed)
    truth, found = {}, {}
    for k in range(images):
        corners = rng.uniform(0.05, 0.7, (rng.integers(0, 6), 2))
        true = np.hstack([corners, corners + rng.uniform(0.05, 0.25, corners.shape)])
        kinds = rng.integers(0, classes, len(true))
        rows = [(kind, *box) for kind, box in zip(kinds, true, strict=True)]
        guesses = []
        for kind, box in zip(kinds, true, strict=True):
            for _ in range(rng.integers(0, 3)):
                moved = np.clip(box + rng.normal(0, 0.02, 4), 0, 1)
                said = kind if rng.random() < 0.9 else rng.integers(0, classes)
                guesses.append((said, *moved, round(float(rng.beta(3, 2)), 2)))
        for _ in range(rng.integers(0, 3)):
            corner = rng.uniform(0, 0.8, 2)
            guesses.append((rng.integers(0, classes), *corner, *(corner + 0.1), round(float(rng.beta(2, 3)), 2)))
        truth[f"walk/{k:03}"], found[f"walk/{k:03}"] = boxes(rows), boxes(guesses)
    return truth, found
