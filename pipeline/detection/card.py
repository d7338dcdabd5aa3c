"""What a model says of itself: the metadata that exporters write beside the network."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.detection.errors import ModelForeign

STRIDE = 32
_DEMONSTRATION = "demonstration"


@dataclass(frozen=True, slots=True)
class Card:
    """names: of the classes, empty where it does not say. size_px: height and width it was exported for, None likewise.

    stride: the input's sides are multiples of it. final: its boxes have been through a suppression. confidence,
    iou: least score and most overlap that its maker advises, 0 likewise. demonstration: its maker says that it is good
    for showing the software only.
    """

    names: tuple[str, ...] = ()
    size_px: tuple[int, int] | None = None
    stride: int = STRIDE
    final: bool = False
    confidence: float = 0.0
    iou: float = 0.0
    demonstration: bool = False


def read_card(metadata: Mapping[str, str]) -> Card:
    """As Ultralytics writes it, and `confidence` and `iou`; values are Python literals. ModelForeign for what cannot be
    meant."""
    task = metadata.get("task", "detect")
    if task != "detect":
        raise ModelForeign(f"its task is {task!r}, expected 'detect'; export a detection model")
    arguments = _literal(metadata, "args")
    return Card(
        names=_names(metadata),
        size_px=_size_px(metadata),
        stride=_stride(metadata),
        final=metadata.get("end2end") == "True" or (isinstance(arguments, dict) and arguments.get("nms") is True),
        confidence=_share(metadata, "confidence"),
        iou=_share(metadata, "iou"),
        demonstration=any(_DEMONSTRATION in value.lower() for value in metadata.values()),
    )


def _names(metadata: Mapping[str, str]) -> tuple[str, ...]:
    found = _literal(metadata, "names")
    if found is None:
        return ()
    if isinstance(found, dict) and sorted(found) == list(range(len(found))):
        found = [found[index] for index in range(len(found))]
    if not isinstance(found, (list, tuple)) or not found or not all(isinstance(name, str) for name in found):
        raise _odd(metadata, "names", "a dictionary of class numbers from 0 and names, such as {0: 'ailanthus'}")
    return tuple(found)


def _size_px(metadata: Mapping[str, str]) -> tuple[int, int] | None:
    found = _literal(metadata, "imgsz")
    if found is None:
        return None
    sides = [found, found] if _is_side(found) else found
    if not isinstance(sides, (list, tuple)) or len(sides) != 2 or not all(map(_is_side, sides)):
        raise _odd(metadata, "imgsz", "height and width in pixels, such as [480, 832]")
    return sides[0], sides[1]


def _stride(metadata: Mapping[str, str]) -> int:
    found = _literal(metadata, "stride")
    if found is None:
        return STRIDE
    if not _is_side(found):
        raise _odd(metadata, "stride", "a number of pixels, such as 32")
    return int(found)


def _share(metadata: Mapping[str, str], key: str) -> float:
    found = _literal(metadata, key)
    if found is None:
        return 0.0
    if not isinstance(found, (int, float)) or not 0.0 < found <= 1.0:
        raise _odd(metadata, key, "a number above 0, at most 1, such as 0.35")
    return float(found)


def _is_side(value: object) -> bool:
    return isinstance(value, int) and 0 < value < 1 << 16


def _literal(metadata: Mapping[str, str], key: str) -> Any:
    """None where the key is missing. A literal only: nothing in a model is ever run as Python."""
    if key not in metadata:
        return None
    try:
        return ast.literal_eval(metadata[key])
    except (ValueError, SyntaxError, MemoryError, RecursionError) as error:
        raise _odd(metadata, key, "a Python literal") from error


def _odd(metadata: Mapping[str, str], key: str, expected: str) -> ModelForeign:
    return ModelForeign(f"its metadata {key!r} is {metadata[key][:80]!r}, expected {expected}")
