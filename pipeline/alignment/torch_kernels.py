"""Where poses are scored: on the processor, compiled, or on a GPU by PyTorch, which is loaded when it is asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.alignment import nmi_kernels
from pipeline.alignment.errors import DeviceError
from pipeline.alignment.grid import Array, Mask

Levels = npt.NDArray[np.int64]
AT_ONCE = 8_000_000
"""Samples: half a gigabyte on the way."""


@dataclass(frozen=True, slots=True)
class Kernels:
    """`pose_information` and `pose_sums` of `nmi_kernels`, or what gives the same to single precision."""

    information: Callable[..., Array]
    sums: Callable[..., Array]


def kernels_on(device: str) -> Kernels:
    """device: cpu, or what PyTorch calls it: cuda, cuda:1.

    Raises `DeviceError` where PyTorch or the device is missing.
    """
    if device == "cpu":
        return Kernels(nmi_kernels.pose_information, nmi_kernels.pose_sums)
    try:
        torch = importlib.import_module("torch")
    except ImportError as error:
        raise DeviceError(
            f"--device {device}: needs PyTorch, which is not installed here; install torch with support for your GPU, "
            "or leave --device out: the processor gives the same answer"
        ) from error
    try:
        torch.zeros(1, dtype=torch.float64, device=device)
    except (RuntimeError, AssertionError, TypeError) as error:
        what = str(error).strip().splitlines()[0]
        raise DeviceError(f"--device {device}: PyTorch cannot use it ({what}); leave it out, or give cuda") from error
    return by_torch(torch, device)


def by_torch(torch: Any, device: str) -> Kernels:
    """torch: the module."""
    return Kernels(partial(_information, torch, device), partial(_sums, torch, device))


def _information(
    torch: Any, device: str, xy: Array, levels: Levels, field: Array, known: Mask, poses: Array, bins: int
) -> Array:
    rows = torch.as_tensor(levels * bins, device=device)
    found = []
    for value in _interpolated(torch, device, xy, field, known, poses):
        at = value * (bins - 1)
        low = at.floor().clamp_(0, bins - 2)
        share = at - low
        # What is not known goes to two bins that nothing is read from.
        bin_of = (rows + low).nan_to_num_(bins * bins).long()
        joint = torch.zeros(len(value), bins * bins + 2, device=device)
        joint.scatter_add_(1, bin_of, 1.0 - share).scatter_add_(1, bin_of.add_(1), share)
        joint = joint[:, :-2].double().reshape(-1, bins, bins)
        used = joint.sum(dim=(1, 2)).round()
        shares = joint / used.clamp(min=1.0)[:, None, None]
        both, first, second = (
            _entropy(torch, one) for one in (shares.flatten(1), shares.sum(dim=1), shares.sum(dim=2))
        )
        information = torch.where(both > 1e-12, (first + second) / both, 1.0)
        found.append(torch.stack([information * (used > 0), both, used], dim=1))
    return np.asarray(torch.cat(found).cpu().numpy())


def _sums(torch: Any, device: str, xy: Array, values: Array, field: Array, known: Mask, poses: Array) -> Array:
    b = torch.as_tensor(values, device=device)
    powers = torch.stack([torch.ones_like(b), b, b * b], dim=1)
    found = []
    for value in _interpolated(torch, device, xy, field, known, poses):
        a = value.nan_to_num(0.0).double()
        n, sb, sbb = ((~value.isnan()).double() @ powers).T
        sa, sab = (a @ powers[:, :2]).T
        found.append(torch.stack([n, sa, sb, (a * a).sum(dim=1), sbb, sab], dim=1))
    return np.asarray(torch.cat(found).cpu().numpy())


def _interpolated(torch: Any, device: str, xy: Array, field: Array, known: Mask, poses: Array) -> Iterator[Any]:
    """(k, n) of so many poses at once; NaN where one of the four cells around is not known, or there is none."""
    image = np.pad(np.where(known, field, np.nan), 1, constant_values=np.nan)
    image = torch.as_tensor(image, dtype=torch.float32, device=device)[None, None]
    samples = torch.as_tensor(np.vstack([xy.T, np.ones(len(xy))]), dtype=torch.float32, device=device)
    turns = torch.as_tensor(_onto_image(poses, field.shape), dtype=torch.float32, device=device)
    for part in turns.split(max(1, AT_ONCE // len(xy))):
        at = (part.reshape(-1, 3) @ samples).reshape(len(part), 2, -1).transpose(1, 2)
        sampled = torch.nn.functional.grid_sample(image, at[None], padding_mode="border", align_corners=True)
        yield sampled[0, 0]


def _onto_image(poses: Array, shape: tuple[int, ...]) -> Array:
    """(k, 2, 3) that take samples (x, y, 1) to y and x in -1..1 over the middles of the outermost cells of the rim."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = np.stack([c, -s, poses[:, 0] + 1.0], axis=1) * 2.0 / (shape[0] + 1)
    y = np.stack([s, c, poses[:, 1] + 1.0], axis=1) * 2.0 / (shape[1] + 1)
    return np.asarray(np.stack([y, x], axis=1) - np.array([0.0, 0.0, 1.0]))


def _entropy(torch: Any, shares: Any) -> Any:
    """(k,) nats of each row."""
    return -torch.special.xlogy(shares, shares).sum(dim=1)
