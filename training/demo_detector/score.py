"""How good a model is on walks it has never seen, in the product's own runtime."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from drivers.sim.boxes import Annotation, TreeBoxes
from drivers.sim.species import TRAITS, Species
from pipeline.detection.detector import Detector, Settings
from pipeline.evaluation.matching import Curve, average_precision, curve, gather, match, overlaps
from training.demo_detector.dataset import Picture, pictures

IOU = 0.5
LEAST_CONFIDENCE = 0.01
"""Of what the average precision looks at."""
WELL_SEEN = Annotation(within_m=15.0, visible_px=600, visible_share=0.5)
WINDOW, WELL_SEEN_IN = 9, 3
"""A tree that is well seen in so many of the nine pictures of three seconds should be found in one of them."""
MISTAKEN_IOU = 0.2
Doubles = npt.NDArray[np.float64]


@dataclass
class Tally:
    """Counts over pictures. compared: of each, the boxes that count, their confidences, and the true boxes.

    found_m, missed_m: ranges of the trees. mistaken_for: what stands where nothing was to be found. windows: see
    `WINDOW`.
    """

    compared: list[tuple[Doubles, Doubles, Doubles]] = field(default_factory=list)
    found_m: list[float] = field(default_factory=list)
    missed_m: list[float] = field(default_factory=list)
    mistaken_for: Counter[str] = field(default_factory=Counter)
    windows: int = 0
    windows_found: int = 0

    def __add__(self, other: Tally) -> Tally:
        return Tally(**{name: getattr(self, name) + getattr(other, name) for name in self.__dataclass_fields__})

    @property
    def trees(self) -> int:
        """That were to be found."""
        return len(self.found_m) + len(self.missed_m)

    @property
    def wrong(self) -> int:
        """Detections where there was nothing to be found."""
        return self.mistaken_for.total()

    @property
    def precision(self) -> float:
        """Share of the detections that are trees."""
        return len(self.found_m) / max(1, len(self.found_m) + self.wrong)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall."""
        return 2.0 * len(self.found_m) / max(1, len(self.found_m) + self.wrong + self.trees)

    def recall(self, from_m: float = 0.0, to_m: float = np.inf) -> float:
        """Share of the trees at that range that are found."""
        found, missed = (sum(from_m <= m < to_m for m in ranges) for ranges in (self.found_m, self.missed_m))
        return found / max(1, found + missed)

    def average_precision(self) -> tuple[float, float]:
        """AP50 and AP50-95, as COCO has them."""
        levels = average_precision(gather(self.compared))
        return float(levels[0]), float(levels.mean())

    def curve(self) -> Curve:
        """Precision and recall at every confidence."""
        return curve(gather(self.compared))


def opened(model: Path) -> Detector:
    """As on the payload's processor, but told to say what it is hardly sure of."""
    return Detector(model, Settings(confidence=LEAST_CONFIDENCE, device="cpu", threads=1))


def score(detector: Detector, walk: Path, rule: Annotation) -> Tally:
    """Of a walk, a folder of `dataset`; found is what the model advises to take for found."""
    total, seen = Tally(), []
    for picture in pictures(walk):
        tally, found = _compared(detector, picture, rule)
        total += tally
        seen.append((_well_seen(picture.boxes), found))
    return total + _windows(seen)


def _compared(detector: Detector, picture: Picture, rule: Annotation) -> tuple[Tally, set[int]]:
    """Counts of one picture, and the trees that were found in it."""
    found = detector.detect(cv2.imread(str(picture.path)), 0)
    ours, counts = picture.boxes.species == Species.TREE_OF_HEAVEN, rule.counts(picture.boxes)
    wanted, left_open = picture.boxes[ours & counts], picture.boxes[ours & ~counts]
    taken = match(overlaps(found.boxes_px, wanted.boxes_px), IOU)
    beside = overlaps(found.boxes_px, left_open.boxes_px).max(axis=1, initial=0.0) >= IOU
    scored, sure = (taken >= 0) | ~beside, found.confidence >= detector.info.advised
    hit = np.isin(np.arange(len(wanted)), taken[sure])
    tally = Tally(
        compared=[(found.boxes_px[scored], found.confidence[scored], wanted.boxes_px)],
        found_m=wanted.range_m[hit].tolist(),
        missed_m=wanted.range_m[~hit].tolist(),
        mistaken_for=Counter(_what(box, picture.boxes) for box in found.boxes_px[sure & scored & (taken < 0)]),
    )
    return tally, set(wanted.tree[hit].tolist())


def _what(box: Doubles, boxes: TreeBoxes) -> str:
    """What stands where a box is that should not be."""
    overlap = overlaps(box[None], boxes.boxes_px)[0]
    ours = boxes.species == Species.TREE_OF_HEAVEN
    if overlap[ours].max(initial=0.0) >= MISTAKEN_IOU:
        return "tree-of-heaven, box off"
    if overlap.max(initial=0.0) >= MISTAKEN_IOU:
        return TRAITS[boxes.species[overlap.argmax()]].name
    return "nothing"


def _well_seen(boxes: TreeBoxes) -> set[int]:
    return set(boxes.tree[(boxes.species == Species.TREE_OF_HEAVEN) & WELL_SEEN.counts(boxes)].tolist())


def _windows(seen: list[tuple[set[int], set[int]]]) -> Tally:
    """seen: of each picture of a walk, the trees that are well seen and those that are found."""
    tally = Tally()
    for start in range(0, len(seen), WINDOW):
        window = seen[start : start + WINDOW]
        often = Counter(tree for well, _ in window for tree in well)
        found = {tree for _, trees in window for tree in trees}
        trees = [tree for tree, times in often.items() if times >= WELL_SEEN_IN]
        tally += Tally(windows=len(trees), windows_found=sum(tree in found for tree in trees))
    return tally
