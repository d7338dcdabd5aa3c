"""How a detector is trained: the published recipe, as the trainer's configuration."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec

from edge.errors import UsageError

Count = Annotated[int, msgspec.Meta(gt=0)]
OPSET = 17
"""What the payload's runtime reads, TensorRT 8.6 included."""


class Recipe(msgspec.Struct, frozen=True):
    """MapForest (arXiv 2603.22502): YOLOv8s at 832 pixels, 200 epochs, base rate 0.001.

    The paper does not name the optimiser. AdamW is what this rate is usual with; the trainer's own choice ("auto")
    would set the rate aside. `yolov8s.pt` is downloaded by the trainer; a path, or yolov8s.yaml (from scratch), is not.
    """

    model: str = "yolov8s.pt"
    imgsz: Count = 832
    epochs: Count = 200
    lr0: Annotated[float, msgspec.Meta(gt=0)] = 0.001
    optimizer: str = "AdamW"
    batch: int = 16
    seed: int = 0
    device: str = ""
    """0, 0,1, cpu, mps; empty: the trainer chooses."""


def configuration(recipe: Recipe, run: Path, more: Sequence[str] = ()) -> dict[str, Any]:
    """What the trainer is told. more: key=value as given by the user, the last word. UsageError."""
    told: dict[str, Any] = {
        "task": "detect",
        "mode": "train",
        "data": str(run / "data.yaml"),
        "project": str(run),
        "name": "train",
        "exist_ok": True,
        **{name: value for name, value in msgspec.structs.asdict(recipe).items() if value != ""},
    }
    for pair in more:
        key, equals, value = pair.partition("=")
        if not equals or not key.isidentifier():
            raise UsageError(f"--set {pair}: expected key=value, such as patience=50")
        told[key] = _value(value)
    return told


def yaml_text(told: dict[str, Any]) -> str:
    """Of a flat table: JSON's words and strings are YAML's."""
    return "".join(f"{key}: {_scalar(value)}\n" for key, value in told.items())


def export_arguments(weights: Path, recipe_told: dict[str, Any]) -> list[str]:
    """To a network with a fixed input, which is what TensorRT builds an engine for."""
    size = recipe_told["imgsz"]
    return ["export", f"model={weights}", "format=onnx", f"imgsz={size}", f"opset={OPSET}", "dynamic=False", "batch=1"]


def _scalar(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    # 1e-05 is a text to YAML 1.1, 1.0e-05 is a number.
    return text.replace("e", ".0e") if isinstance(value, float) and "e" in text and "." not in text else text


def _value(text: str) -> Any:
    try:
        return json.loads(text.lower() if text in ("True", "False") else text)
    except ValueError:
        return text
