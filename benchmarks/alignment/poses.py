"""Time for a thousand candidate poses of the published score, ours beside plain PyTorch, as the map grows."""

from __future__ import annotations

import json
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy import ndimage

from pipeline.alignment.nmi_kernels import pose_information

SIDES_M = (25, 50, 100)
CELL_M, BINS, POSES = 0.5, 16, 1000
MARGIN_M = 12.0


def compare(python: Path | None) -> str:
    """A row a size, in Markdown. python: one with torch."""
    rows = ["| footprint | cells | ours, wall ms | ours, CPU ms | torch, wall ms | torch, CPU ms | NMI apart |"]
    rows.append("| ---: " * 7 + "|")
    for side_m in SIDES_M:
        count, margin = round(side_m / CELL_M), round(MARGIN_M / CELL_M)
        rng = np.random.default_rng(5)
        field = _scaled(ndimage.gaussian_filter(rng.normal(size=(count + 2 * margin,) * 2), 3.0))
        levels = rng.integers(0, BINS, count * count)
        line = np.arange(count) - (count - 1) / 2
        xy = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
        middle = (field.shape[0] - 1) / 2
        poses = np.column_stack([rng.uniform(-6, 6, (POSES, 2)) + middle, rng.uniform(-0.1, 0.1, POSES)])
        known = np.ones(field.shape, np.bool_)
        pose_information(xy, levels, field, known, poses[:2], BINS)
        cpu, wall = time.process_time(), time.perf_counter()
        found = pose_information(xy, levels, field, known, poses, BINS)[:, 0]
        ours = 1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - cpu)
        beside = _torch(python, {"xy": xy, "levels": levels, "field": field, "poses": poses, "found": found})
        rows.append(f"| {side_m} m | {count**2:,} | {ours[0]:,.0f} | {ours[1]:,.0f} | {beside}")
    return "\n".join(rows)


def _torch(python: Path | None, arrays: dict[str, np.ndarray]) -> str:
    if python is None:
        return "- | - | - |"
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder) / "poses.npz", **arrays)
        script = Path(__file__).with_name("run_torch.py")
        told = json.loads(subprocess.run([python, script, folder], check=True, capture_output=True, text=True).stdout)
    return f"{told['wall_ms']:,.0f} | {told['cpu_ms']:,.0f} | {told['apart']:.1e} |"


def _scaled(field: np.ndarray) -> np.ndarray:
    low, high = field.min(), field.max()
    return np.asarray((field - low) / (high - low))
