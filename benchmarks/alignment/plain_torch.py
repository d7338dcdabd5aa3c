"""The published score in plain PyTorch: `grid_sample`, then a joint histogram by `scatter_add`. Nothing of ours."""

from __future__ import annotations

import numpy as np
import torch

BINS, AT_ONCE_SAMPLES = 16, 4_000_000


def scores(xy: np.ndarray, levels: np.ndarray, field: np.ndarray, poses: np.ndarray, device: str) -> np.ndarray:
    """(k,) normalised mutual information; every sample falls on the field here. In single precision, as one would."""
    image, samples, moves = (torch.as_tensor(one, dtype=torch.float32, device=device) for one in (field, xy, poses))
    bins = torch.as_tensor(levels, device=device)
    parts = moves.split(max(1, AT_ONCE_SAMPLES // len(xy)))
    return np.asarray(torch.cat([information(image, samples, bins, part) for part in parts]).cpu().numpy())


def information(field: torch.Tensor, xy: torch.Tensor, levels: torch.Tensor, poses: torch.Tensor) -> torch.Tensor:
    """(k,)"""
    c, s = torch.cos(poses[:, 2:3]), torch.sin(poses[:, 2:3])
    x = c * xy[:, 0] - s * xy[:, 1] + poses[:, 0:1]
    y = s * xy[:, 0] + c * xy[:, 1] + poses[:, 1:2]
    wide, high = field.shape
    grid = torch.stack([2 * y / (high - 1) - 1, 2 * x / (wide - 1) - 1], dim=-1)[:, None]
    image = field[None, None].expand(len(poses), -1, -1, -1)
    value = torch.nn.functional.grid_sample(image, grid, align_corners=True)[:, 0, 0] * (BINS - 1)
    low = value.long().clamp(0, BINS - 2)
    share = value - low
    at = levels * BINS + low
    joint = torch.zeros(len(poses), BINS * BINS, device=field.device)
    joint.scatter_add_(1, at, 1 - share).scatter_add_(1, at + 1, share)
    joint = (joint / joint.sum(dim=1, keepdim=True)).reshape(-1, BINS, BINS)
    both = entropy(joint.reshape(len(poses), -1))
    return (entropy(joint.sum(1)) + entropy(joint.sum(2))) / both


def entropy(shares: torch.Tensor) -> torch.Tensor:
    """In nats, of each row."""
    return -torch.special.xlogy(shares, shares).sum(dim=1)
