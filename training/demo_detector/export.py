"""The trained network as an ONNX file in the layout of YOLOv8, with what it is for written inside."""

from __future__ import annotations

from pathlib import Path

import onnx
import torch

from training.demo_detector.network import STRIDES, DemoDetector, Exported

OPSET = 17
CLASS_NAME = "tree-of-heaven"
NOTE = (
    "For demonstration only, not for the field: trained on pictures of a simulated forest and on nothing else. "
    "What it says of a real forest means nothing."
)


def export(network: DemoDetector, input_px: tuple[int, int], confidence: float, path: Path) -> None:
    """Write it with a fixed input of that height and width. confidence: the least that is advised."""
    height, width = input_px
    path.parent.mkdir(parents=True, exist_ok=True)
    torch.onnx.export(
        Exported(network, height, width).eval(),
        (torch.zeros(1, 3, height, width),),
        str(path),
        input_names=["images"],
        output_names=["output0"],
        opset_version=OPSET,
        dynamo=False,
    )
    model = onnx.load(str(path))
    onnx.helper.set_model_props(model, card(input_px, confidence))
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, str(path))


def card(input_px: tuple[int, int], confidence: float) -> dict[str, str]:
    """The metadata: what Ultralytics' exporter writes, the operating point, and a warning."""
    return {
        "description": f"Tree-of-Heaven in the simulated forest of mapforest. {NOTE}",
        "author": "the mapforest developers",
        "license": "Apache-2.0",
        "version": "1",
        "task": "detect",
        "stride": str(max(STRIDES)),
        "batch": "1",
        "imgsz": str(list(input_px)),
        "names": str({0: CLASS_NAME}),
        "confidence": f"{confidence:g}",
        "iou": "0.65",  # it grows in clumps: the boxes of neighbours overlap
        "purpose": "demonstration only",
    }
