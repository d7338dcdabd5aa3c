"""The network: a small one-stage detector without anchors, 1 x 3 x height x width to 1 x (4 + classes) x N."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

STRIDES = (8, 16, 32)
PRIOR = 0.01
"""Score of an untrained network everywhere: most of a picture is background."""
LARGEST_LOG = 5.0
"""Of a box's side in strides; keeps the exponential finite at the start of training."""


class Conv(nn.Sequential):
    """Convolution, normalisation, rectifier. The rectifier costs nothing: onnxruntime fuses it."""

    def __init__(self, inputs: int, outputs: int, size: int = 3, stride: int = 1) -> None:
        super().__init__(
            nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()
        )


class Split(nn.Module):
    """Half of the channels pass by, half go through residual steps whose results are all kept (as in CSPNet, ELAN)."""

    def __init__(self, inputs: int, outputs: int, steps: int = 1) -> None:
        super().__init__()
        half = outputs // 2
        self.enter = Conv(inputs, outputs, 1)
        self.steps = nn.ModuleList(nn.Sequential(Conv(half, half), Conv(half, half)) for _ in range(steps))
        self.leave = Conv(outputs + steps * half, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        """(b, inputs, h, w) to (b, outputs, h, w)."""
        parts = list(self.enter(x).chunk(2, dim=1))
        for step in self.steps:
            parts.append(parts[-1] + step(parts[-1]))
        return self.leave(torch.cat(parts, dim=1))


class Around(nn.Module):
    """What is seen farther around each place: maxima over growing windows (spatial pyramid pooling)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.enter = Conv(channels, channels // 2, 1)
        self.pool = nn.MaxPool2d(5, 1, 2)
        self.leave = Conv(2 * channels, channels, 1)

    def forward(self, x: Tensor) -> Tensor:
        """(b, channels, h, w), same out."""
        parts = [self.enter(x)]
        for _ in range(3):
            parts.append(self.pool(parts[-1]))
        return self.leave(torch.cat(parts, dim=1))


class Head(nn.Module):
    """Boxes and class scores of one feature map."""

    def __init__(self, channels: int, classes: int) -> None:
        super().__init__()
        self.box = nn.Sequential(Conv(channels, channels), nn.Conv2d(channels, 4, 1))
        self.score = nn.Sequential(Conv(channels, channels), nn.Conv2d(channels, classes, 1))
        nn.init.constant_(self.score[-1].bias, -float(torch.tensor(1.0 / PRIOR - 1.0).log()))

    def forward(self, x: Tensor) -> Tensor:
        """(b, 4 + classes, cells): offset and log size in strides, score as a logit."""
        return torch.cat([self.box(x), self.score(x)], dim=1).flatten(2)


class DemoDetector(nn.Module):
    """Backbone, a pyramid down and up again, a head for each stride."""

    def __init__(self, widths: Sequence[int] = (16, 32, 64, 96, 112), neck: int = 48, classes: int = 1) -> None:
        super().__init__()
        w1, w2, w3, w4, w5 = widths
        self.stem = nn.Sequential(Conv(3, w1, 3, 2), Conv(w1, w2, 3, 2), Split(w2, w2))
        self.c3 = nn.Sequential(Conv(w2, w3, 3, 2), Split(w3, w3, 2))
        self.c4 = nn.Sequential(Conv(w3, w4, 3, 2), Split(w4, w4, 2))
        self.c5 = nn.Sequential(Conv(w4, w5, 3, 2), Split(w5, w5, 1), Around(w5))
        self.lateral = nn.ModuleList(Conv(width, neck, 1) for width in (w3, w4, w5))
        self.down = nn.ModuleList(Split(neck, neck) for _ in range(2))
        self.shrink = nn.ModuleList(Conv(neck, neck, 3, 2) for _ in range(2))
        self.up = nn.ModuleList(Split(neck, neck) for _ in range(2))
        self.heads = nn.ModuleList(Head(neck, classes) for _ in STRIDES)
        self.enlarge = nn.Upsample(scale_factor=2, mode="nearest")

    def forward(self, images: Tensor) -> Tensor:
        """RGB 0..1 (b, 3, h, w), sides multiples of 32, to raw output (b, 4 + classes, N)."""
        c3 = self.c3(self.stem(images))
        c4 = self.c4(c3)
        p3, p4, p5 = (lateral(c) for lateral, c in zip(self.lateral, (c3, c4, self.c5(c4)), strict=True))
        p4 = self.down[0](p4 + self.enlarge(p5))
        p3 = self.down[1](p3 + self.enlarge(p4))
        p4 = self.up[0](p4 + self.shrink[0](p3))
        p5 = self.up[1](p5 + self.shrink[1](p4))
        return torch.cat([head(p) for head, p in zip(self.heads, (p3, p4, p5), strict=True)], dim=2)


def cells(height: int, width: int) -> Tensor:
    """(3, N) centre x, centre y and stride, in pixels of the input, of each place of the output."""
    parts = []
    for stride in STRIDES:
        y, x = torch.meshgrid(torch.arange(height // stride), torch.arange(width // stride), indexing="ij")
        parts.append(torch.stack([(x + 0.5) * stride, (y + 0.5) * stride, torch.full(x.shape, stride)]).flatten(1))
    return torch.cat(parts, dim=1)


def boxes(raw: Tensor, places: Tensor) -> Tensor:
    """(b, 4, N) cx, cy, w, h in pixels of the input, from the raw output and its cells."""
    stride = places[2]
    centre = places[:2] + raw[:, :2] * stride
    return torch.cat([centre, raw[:, 2:4].clamp(max=LARGEST_LOG).exp() * stride], dim=1)


class Exported(nn.Module):
    """The network with its output in the layout of YOLOv8: boxes in pixels, scores 0..1."""

    def __init__(self, network: DemoDetector, height: int, width: int) -> None:
        super().__init__()
        self.network = network
        self.places: Tensor
        self.register_buffer("places", cells(height, width))

    def forward(self, images: Tensor) -> Tensor:
        """(1, 3, h, w) to (1, 4 + classes, N)."""
        raw = self.network(images)
        return torch.cat([boxes(raw, self.places), raw[:, 4:].sigmoid()], dim=1)
