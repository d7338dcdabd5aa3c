"""What one device and one way of walking add to every diameter, from marked trees that were taped by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np
import numpy.typing as npt

from pipeline.inventory.errors import InventoryError
from pipeline.inventory.field_list import FieldTree
from pipeline.inventory.trees import ListedTree

Doubles = npt.NDArray[np.float64]
PRIOR_M = 0.01
"""Before any marked tree: no bias, give or take this."""
WITHIN_M = 1.0
OUTLIER = 3.0


class DeviceBias(msgspec.Struct, frozen=True):
    """offset_m: measured less taped; sigma_m of it; marked: trees that told it; spread_m: of their errors about it."""

    offset_m: float
    sigma_m: float
    marked: int
    spread_m: float


def fit_device_bias(trees: Sequence[ListedTree], marked: Sequence[FieldTree]) -> DeviceBias:
    """From measured trees that stand where marked ones do, in the coordinates of the map. InventoryError where none
    does."""
    bases = np.array([tree.position_m[:2] for tree in trees]).reshape(-1, 2)
    errors, sigmas = [], []
    for one in marked:
        away = np.hypot(bases[:, 0] - one.x_m, bases[:, 1] - one.y_m)
        k = int(away.argmin()) if len(away) else -1
        if k >= 0 and away[k] < WITHIN_M and trees[k].stem is not None:
            errors.append(trees[k].dbh_m - one.dbh_m)
            sigmas.append(trees[k].dbh_sigma_m)
    if not errors:
        raise InventoryError(
            f"none of the {len(marked)} marked trees stands within {WITHIN_M:g} m of a measured one; are the field "
            "list and the map in the same coordinates?"
        )
    return _fitted(np.array(errors), np.array(sigmas))


def _fitted(errors: Doubles, sigmas: Doubles) -> DeviceBias:
    """Weighted mean with a prior of none, without what is far off: a wrong pair, or a slip of the tape."""
    kept = np.abs(errors - np.median(errors)) <= OUTLIER * np.maximum(sigmas, 0.01)
    weight = 1.0 / (sigmas[kept] ** 2 + 0.003**2)
    total = weight.sum() + PRIOR_M**-2
    offset = float((weight * errors[kept]).sum() / total)
    spread = float(np.sqrt(np.mean((errors[kept] - offset) ** 2)))
    return DeviceBias(offset, float(total**-0.5), int(kept.sum()), spread)


def corrected(trees: Sequence[ListedTree], bias: DeviceBias) -> list[ListedTree]:
    """Measured diameters less the bias, with its sigma; what was taped by hand stays."""
    return [
        replace(
            tree,
            dbh_m=max(tree.dbh_m - bias.offset_m, 0.01),
            dbh_sigma_m=float(np.hypot(tree.dbh_sigma_m, bias.sigma_m)),
        )
        if tree.stem is not None and np.isfinite(tree.dbh_sigma_m)
        else tree
        for tree in trees
    ]
