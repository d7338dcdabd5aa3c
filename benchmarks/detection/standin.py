"""A network with weights of chance, for timing where no model is at hand: 1.9 G multiplications at 640 x 640, half of
YOLOv8n's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

CHANNELS = (16, 32, 64, 128, 256)
"""After each halving of the image; those at 1/8, 1/16 and 1/32 are looked at."""
REPEATS = (0, 1, 2, 2, 1)
UNLIKELY = -12.0
"""Bias of the scores: chance finds next to nothing, as a good detector in a forest without the tree."""


class _Net:
    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.weights: dict[str, np.ndarray] = {}
        self._rng = np.random.default_rng(1)

    def add(self, kind: str, *inputs: str, **attributes: object) -> str:
        name = f"t{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def put(self, value: np.ndarray) -> str:
        name = f"w{len(self.weights)}"
        self.weights[name] = value
        return name

    def conv(self, x: str, channels: tuple[int, int], size: int, stride: int = 1, bias: float = 0.0) -> str:
        fan = channels[0] * size * size
        weight = self._rng.normal(0, (2 / fan) ** 0.5, (channels[1], channels[0], size, size)).astype(np.float32)
        shift = np.full(channels[1], bias, np.float32)
        edge = [size // 2] * 4
        return self.add("Conv", x, self.put(weight), self.put(shift), strides=[stride] * 2, pads=edge)

    def silu(self, x: str) -> str:
        return self.add("Mul", x, self.add("Sigmoid", x))

    def flat(self, x: str, fields: int) -> str:
        return self.add("Reshape", x, self.put(np.array([1, fields, -1], np.int64)))


def write(path: Path, input_px: tuple[int, int]) -> Path:
    """One class, output 1 x 5 x N as of YOLOv8."""
    net, last, x = _Net(), 3, "images"
    boxes, scores = [], []
    for level, (channels, repeats) in enumerate(zip(CHANNELS, REPEATS, strict=True)):
        x = net.silu(net.conv(x, (last, channels), 3, 2))
        for _ in range(repeats):
            x = net.add("Add", x, net.silu(net.conv(x, (channels, channels), 3)))
        last = channels
        if level >= 2:
            boxes.append(net.flat(net.add("Relu", net.conv(x, (channels, 4), 1)), 4))
            scores.append(net.flat(net.add("Sigmoid", net.conv(x, (channels, 1), 1, bias=UNLIKELY)), 1))
    both = [net.add("Concat", *parts, axis=2) for parts in (boxes, scores)]
    net.nodes.append(helper.make_node("Concat", both, ["output0"], axis=1))
    graph = helper.make_graph(
        net.nodes,
        "standin",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, (1, 3, *input_px))],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, (1, 5, "N"))],
        [numpy_helper.from_array(value, name) for name, value in net.weights.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    helper.set_model_props(model, {"names": "{0: 'nothing'}", "task": "detect", "stride": "32"})
    onnx.save(model, path)
    return path
