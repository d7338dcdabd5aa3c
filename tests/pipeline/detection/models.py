"""Tiny networks with the outputs of real detectors, for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

CELL = 32
OPSET, IR = 17, 8
"""What the oldest supported runtime reads."""
TYPES = {np.dtype(np.float32): TensorProto.FLOAT, np.dtype(np.float16): TensorProto.FLOAT16}


def constant(path: Path, output: np.ndarray, *, shape=(1, 3, 64, 96), outputs=("output0",), **metadata) -> Path:
    """Says the same of every image. shape: of the input, texts for sides that are open."""
    kind = TYPES[output.dtype]
    nothing = np.zeros((), output.dtype)
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "nothing"], ["zero"]),
        *(helper.make_node("Add", ["said", "zero"], [name]) for name in outputs),
    ]
    values = {"nothing": nothing, "said": output}
    return _write(path, nodes, values, (kind, shape), dict.fromkeys(outputs, (kind, output.shape)), metadata)


def spotter(path: Path, size_px=(480, 832), names=("red", "blue"), **metadata) -> Path:
    """Finds red, and blue where there are two names: a box for each cell of that colour. Output as of YOLOv8."""
    height, width = size_px
    rows, columns = height // CELL, width // CELL
    y, x = np.mgrid[:rows, :columns].reshape(2, -1) * CELL + CELL / 2
    boxes = np.stack([x, y, np.full_like(x, CELL), np.full_like(x, CELL)])[None].astype(np.float32)
    gain = np.array([[1.0, -0.5, -0.5], [-0.5, -0.5, 1.0]], np.float32)[: len(names), :, None, None] * 20.0
    values = {
        "boxes": boxes,
        "gain": gain,
        "least": np.full(len(names), -8.0, np.float32),
        "flat": np.array([1, len(names), -1], np.int64),
    }
    nodes = [
        helper.make_node("AveragePool", ["images"], ["cells"], kernel_shape=[CELL, CELL], strides=[CELL, CELL]),
        helper.make_node("Conv", ["cells", "gain", "least"], ["logits"]),
        helper.make_node("Sigmoid", ["logits"], ["sure"]),
        helper.make_node("Reshape", ["sure", "flat"], ["scores"]),
        helper.make_node("Concat", ["boxes", "scores"], ["output0"], axis=1),
    ]
    ends = {"output0": (TensorProto.FLOAT, (1, 4 + len(names), rows * columns))}
    told = {"names": str(dict(enumerate(names))), "task": "detect", "stride": "32", "imgsz": str([height, width])}
    return _write(path, nodes, values, (TensorProto.FLOAT, (1, 3, height, width)), ends, told | metadata)


def _write(path, nodes, values, start, ends, metadata) -> Path:  # noqa: PLR0917
    graph = helper.make_graph(
        nodes,
        "test",
        [helper.make_tensor_value_info("images", *start)],
        [helper.make_tensor_value_info(name, *end) for name, end in ends.items()],
        [numpy_helper.from_array(value, name) for name, value in values.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR)
    helper.set_model_props(model, {key: str(value) for key, value in metadata.items()})
    onnx.checker.check_model(model)
    onnx.save(model, path)
    return path
