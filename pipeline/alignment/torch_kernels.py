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
AT_ONCE = 2_000_000
"""Samples: half a gigabyte on the way."""


@dataclass(frozen=True, slots=True)
class Kernels:
    """`pose_information` and `pose_sums` of `nmi_kernels`, or what gives the same to rounding."""

    information: Callable[..., Array]
    sums: Callable[..., Array]


def kernels(device: str) -> Kernels:
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
    torch: Any,
    device: str,
    xy: Array,
    levels: Levels,
    field: Array,
    known: Mask,
    poses: Array,
    bins: int,
) -> Array:
    of = torch.nn.functional.one_hot(torch.as_tensor(levels, device=device), bins).double()
    line = torch.arange(bins, dtype=torch.float64, device=device)[:, None]
    found = []
    for value in _interpolated(torch, device, xy, field, known, poses, bins):
        used = ~value.isnan()
        # A sample gives to the two bins next to it by nearness; what is not known lies far from all.
        at = torch.where(used, value * (bins - 1), -2.0)
        joint = (at[:, None, :] - line).abs_().neg_().add_(1.0).clamp_(min=0.0) @ of
        total = used.sum(dim=1).clamp(min=1)[:, None]
        both, first, second = (
            _entropy(torch, counts / total) for counts in (joint.flatten(1), joint.sum(dim=1), joint.sum(dim=2))
        )
        information = torch.where(both > 1e-12, (first + second) / both, 1.0)
        some = used.any(dim=1)
        found.append(torch.stack([information * some, both, used.sum(dim=1).double()], dim=1))
    return np.asarray(torch.cat(found).cpu().numpy())


def _sums(torch: Any, device: str, xy: Array, values: Array, field: Array, known: Mask, poses: Array) -> Array:
    b = torch.as_tensor(values, device=device)
    powers = torch.stack([torch.ones_like(b), b, b * b], dim=1)
    found = []
    for value in _interpolated(torch, device, xy, field, known, poses, 1):
        a = value.nan_to_num(0.0)
        n, sb, sbb = ((~value.isnan()).double() @ powers).T
        sa, sab = (a @ powers[:, :2]).T
        found.append(torch.stack([n, sa, sb, (a * a).sum(dim=1), sbb, sab], dim=1))
    return np.asarray(torch.cat(found).cpu().numpy())


def _interpolated(
    torch: Any, device: str, xy: Array, field: Array, known: Mask, poses: Array, wide: int
) -> Iterator[Any]:
    """(k, n) of so many poses at once; NaN where one of the four cells around is not known."""
    corners = [(slice(i, i - 1 or None), slice(j, j - 1 or None)) for i in (0, 1) for j in (0, 1)]
    around = np.stack([np.where(known, field, np.nan)[corner].ravel() for corner in corners], axis=1)
    # The last row stands for all beyond the rim.
    table = torch.as_tensor(np.vstack([around, np.full((1, 4), np.nan)]), device=device)
    samples, at = torch.as_tensor(xy, device=device), torch.as_tensor(poses, device=device)
    nx, ny = field.shape[0] - 1, field.shape[1] - 1
    for part in at.split(max(1, AT_ONCE // (len(xy) * -(-wide // 4)))):
        c, s = torch.cos(part[:, 2:]), torch.sin(part[:, 2:])
        x = c * samples[:, 0] - s * samples[:, 1] + part[:, :1]
        y = s * samples[:, 0] + c * samples[:, 1] + part[:, 1:2]
        ix, iy = x.floor(), y.floor()
        inside = (ix >= 0) & (iy >= 0) & (ix < nx) & (iy < ny)
        four = table[torch.where(inside, ix * ny + iy, nx * ny).long()]
        fx, fy = x - ix, y - iy
        near = (1.0 - fy) * four[..., 0] + fy * four[..., 1]
        far = (1.0 - fy) * four[..., 2] + fy * four[..., 3]
        yield (1.0 - fx) * near + fx * far


def _entropy(torch: Any, shares: Any) -> Any:
    """(k,) nats of each row."""
    return -torch.special.xlogy(shares, shares).sum(dim=1)
