"""The training loop; it goes on where it was stopped."""

from __future__ import annotations

import copy
import math
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from drivers.sim.boxes import Annotation
from training.demo_detector.dataset import Picture
from training.demo_detector.examples import Batch, batches, shrunk
from training.demo_detector.loss import loss
from training.demo_detector.network import DemoDetector, boxes, cells


@dataclass(frozen=True)
class Recipe:
    """input_px: height, width, multiples of 32. rate: the highest learning rate."""

    input_px: tuple[int, int] = (256, 416)
    epochs: int = 16
    batch: int = 16
    rate: float = 2e-3
    decay: float = 0.02
    warm_up_steps: int = 200
    average: float = 0.998
    seed: int = 1
    threads: int = 1
    rule: Annotation = field(default_factory=Annotation)


def trained(checkpoint: Path) -> DemoDetector:
    """The averaged network of a checkpoint."""
    network = DemoDetector().eval()
    network.load_state_dict(torch.load(checkpoint, weights_only=True)["average"])
    return network


def train(pictures: list[Picture], recipe: Recipe, checkpoint: Path) -> DemoDetector:
    """The averaged network. Continues from the checkpoint where there is one."""
    torch.set_num_threads(recipe.threads)
    torch.manual_seed(recipe.seed)
    network = DemoDetector().to(memory_format=torch.channels_last)
    average = copy.deepcopy(network).eval()
    optimiser = torch.optim.AdamW(_groups(network, recipe.decay), lr=recipe.rate, betas=(0.9, 0.99))
    begun = _resume(checkpoint, network, average, optimiser)
    small = [shrunk(picture, recipe.rule, recipe.input_px) for picture in pictures]
    steps = len(small) // recipe.batch
    places = cells(*recipe.input_px)
    for epoch in range(begun, recipe.epochs):
        started_s, total = time.monotonic(), 0.0
        rng = np.random.default_rng([recipe.seed, epoch])
        for k, batch in enumerate(batches(small, recipe.input_px, recipe.batch, rng)):
            step = epoch * steps + k
            for group in optimiser.param_groups:
                group["lr"] = recipe.rate * _share(step, steps * recipe.epochs, recipe.warm_up_steps)
            total += _step(network, optimiser, batch, places)
            _follow(average, network, min(recipe.average, (1 + step) / (10 + step)))
        print(f"epoch {epoch}: loss {total / steps:.3f}, {time.monotonic() - started_s:.0f} s", flush=True)
        _save(checkpoint, epoch + 1, network, average, optimiser)
    return average


def _step(
    network: DemoDetector,
    optimiser: torch.optim.Optimizer,
    batch: Batch,
    places: Tensor,
) -> float:
    network.train()
    with torch.autocast("cpu", torch.bfloat16):
        raw = network(batch.images.contiguous(memory_format=torch.channels_last)).float()
    value = loss(raw, boxes(raw, places), places, batch.wanted, batch.left_open)
    optimiser.zero_grad(set_to_none=True)
    value.backward()
    nn.utils.clip_grad_norm_(network.parameters(), 10.0)
    optimiser.step()
    return float(value.detach())


def _groups(network: nn.Module, decay: float) -> list[dict[str, object]]:
    """Filters decay, offsets and normalisations do not."""
    filters = [p for p in network.parameters() if p.ndim > 1]
    rest = [p for p in network.parameters() if p.ndim <= 1]
    return [{"params": filters, "weight_decay": decay}, {"params": rest, "weight_decay": 0.0}]


def _share(step: int, steps: int, warm_up: int) -> float:
    """Of the highest learning rate: a short rise, then half a cosine down to a hundredth."""
    if step < warm_up:
        return (step + 1) / warm_up
    return 0.01 + 0.99 * 0.5 * (1.0 + math.cos(math.pi * (step - warm_up) / max(1, steps - warm_up)))


@torch.no_grad()
def _follow(average: nn.Module, network: nn.Module, keep: float) -> None:
    for slow, fast in zip(average.state_dict().values(), network.state_dict().values(), strict=True):
        if slow.dtype.is_floating_point:
            slow.lerp_(fast, 1.0 - keep)


def _save(path: Path, epoch: int, network: nn.Module, average: nn.Module, optimiser: torch.optim.Optimizer) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    states = {"network": network, "average": average, "optimiser": optimiser}
    half = path.with_suffix(".part")
    torch.save({"epoch": epoch, **{name: part.state_dict() for name, part in states.items()}}, half)
    half.replace(path)


def _resume(path: Path, network: nn.Module, average: nn.Module, optimiser: torch.optim.Optimizer) -> int:
    """The epoch to go on with."""
    if not path.exists():
        return 0
    saved = torch.load(path, weights_only=True)
    network.load_state_dict(saved["network"])
    average.load_state_dict(saved["average"])
    optimiser.load_state_dict(saved["optimiser"])
    return int(saved["epoch"])
