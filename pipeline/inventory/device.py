"""What one device and one way of walking add to every diameter, from marked trees that were taped by hand."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from pipeline.inventory.errors import InventoryError
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


class MarkedTree(msgspec.Struct, frozen=True):
    """A line of a field list, in the coordinates of the map."""

    x_m: float
    y_m: float
    dbh_m: float
    tag: str = ""


def read_field_list(path: Path) -> list[MarkedTree]:
    """A CSV with the columns x, y, dbh_cm and perhaps tag. InventoryError names file, line and what was expected."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.DictReader(line for line in file if line.strip() and not line.startswith("#"))
            names = set(rows.fieldnames or ())
            if not {"x", "y", "dbh_cm"} <= names:
                raise InventoryError(
                    f"{path}: found the columns {', '.join(sorted(names)) or 'none'}; expected x, y, dbh_cm, and tag"
                )
            found = []
            for row in rows:
                dbh = float(row["dbh_cm"])
                if not 1.0 <= dbh <= 500.0:
                    raise InventoryError(f"{path}:{rows.line_num}: a diameter of {dbh:g} cm; they are in centimetres")
                tag = row.get("tag") or ""
                found.append(MarkedTree(float(row["x"]), float(row["y"]), dbh / 100.0, tag))
    except (OSError, UnicodeDecodeError) as error:
        raise InventoryError(f"{path}: cannot be read ({error})") from error
    except (ValueError, TypeError) as error:
        raise InventoryError(f"{path}:{rows.line_num}: x, y and dbh_cm are numbers ({error})") from error
    if not found:
        raise InventoryError(f"{path}: has no trees")
    return found


def fit_device_bias(trees: Sequence[ListedTree], marked: Sequence[MarkedTree]) -> DeviceBias:
    """From measured trees that stand where marked ones do. InventoryError where none does."""
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
