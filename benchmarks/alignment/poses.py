"""Time for a thousand candidate poses of the published score, ours beside plain PyTorch, as the map grows.

Needs numpy, scipy and numba; with PyTorch in the same environment the other columns are filled.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np
from numba import get_num_threads
from scipy import ndimage

from pipeline.alignment.torch_kernels import by_torch, kernels_on

SIDES_M = (25, 50, 100, 200)
CELL_M, BINS, POSES = 0.5, 16, 1000
GPU_POSES = 20_000
"""Of a search over tens of metres and all turns; a thousand do not fill a GPU."""
MARGIN_M = 12.0
ROUNDS = 3


@dataclass(frozen=True)
class Made:
    """A made-up field, samples of another one, and poses that keep all of them on the field."""

    xy: np.ndarray
    levels: np.ndarray
    field: np.ndarray
    poses: np.ndarray


def compare(device: str) -> str:
    """A row a size, in Markdown; the best of some rounds each. device: of PyTorch."""
    rows = []
    for side_m in SIDES_M:
        made = _made(side_m)
        methods = _methods(device)
        found = {name: _timed(run, made, count) for name, (run, count) in methods.items()}
        numba = found["Numba"][0]
        cells = [f"{side_m} m", f"{len(made.xy):,}", *(f"{wall:,.2f} | {cpu:,.2f}" for _, wall, cpu in found.values())]
        cells += [f"{np.abs(one[:POSES] - numba).max():.0e}" for one, _, _ in list(found.values())[1:]]
        rows.append("| " + " | ".join(cells) + " |")
        print(rows[-1], flush=True)
    head = ["footprint", "cells", *(f"{name}, wall ms | CPU ms" for name in methods)]
    head += [f"{name}, apart" for name in list(methods)[1:]]
    titles = " | ".join(head)
    line = "|" + " ---: |" * (titles.count("|") + 1)
    return "\n".join([f"\n{_machine(device)}; for a thousand poses\n", f"| {titles} |", line, *rows])


def _methods(device: str) -> dict[str, tuple[Callable[[Made], np.ndarray], int]]:
    """Each with the poses it gets."""
    found = {"Numba": (_by(kernels_on("cpu").information), POSES)}
    if find_spec("torch") is None:
        return found
    import torch

    from benchmarks.alignment import plain_torch

    def plain(made: Made) -> np.ndarray:
        return plain_torch.scores(made.xy, made.levels, made.field, made.poses, device)

    count = POSES if device == "cpu" else GPU_POSES
    found["plain PyTorch"] = (plain, count)
    if device != "cpu":
        found[f"ours on {device}"] = (_by(by_torch(torch, device).information), count)
    return found


def _by(information: Callable[..., np.ndarray]) -> Callable[[Made], np.ndarray]:
    def run(made: Made) -> np.ndarray:
        known = np.ones(made.field.shape, np.bool_)
        return information(made.xy, made.levels, made.field, known, made.poses, BINS)[:, 0]

    return run


def _timed(run: Callable[[Made], np.ndarray], made: Made, count: int) -> tuple[np.ndarray, float, float]:
    """What it gives; milliseconds a thousand poses of wall clock and of all threads, copies to the device included."""
    made, times = replace(made, poses=made.poses[:count]), []
    found = run(made)
    for _ in range(ROUNDS):
        wall, cpu = time.perf_counter(), time.process_time()
        run(made)
        times.append(((time.perf_counter() - wall) / count, (time.process_time() - cpu) / count))
    wall, cpu = min(times)
    return found, 1e6 * wall, 1e6 * cpu


def _made(side_m: int) -> Made:
    count, margin = round(side_m / CELL_M), round(MARGIN_M / CELL_M)
    rng = np.random.default_rng(5)
    field = ndimage.gaussian_filter(rng.normal(size=(count + 2 * margin,) * 2), 3.0)
    line = np.arange(count) - (count - 1) / 2
    xy = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    middle = (field.shape[0] - 1) / 2
    turn = 8.0 / count
    poses = np.column_stack([rng.uniform(-12, 12, (GPU_POSES, 2)) + middle, rng.uniform(-turn, turn, GPU_POSES)])
    field = (field - field.min()) / (field.max() - field.min())
    return Made(xy, rng.integers(0, BINS, count * count), field, poses)


def _machine(device: str) -> str:
    """Threads and devices that the times are of."""
    if find_spec("torch") is None:
        return f"Numba with {get_num_threads()} threads; no PyTorch here"
    import torch

    name = torch.cuda.get_device_name(device) if device != "cpu" else f"{torch.get_num_threads()} threads"
    return f"Numba with {get_num_threads()} threads, PyTorch {torch.__version__} on {device}: {name}"
