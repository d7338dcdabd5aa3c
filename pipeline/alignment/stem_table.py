"""Stems from a CSV file: of an inventory, a field crew, or another program."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.alignment.errors import CloudError
from pipeline.alignment.grid import Array

_X = ("x", "x_m", "easting", "easting_m", "east")
_Y = ("y", "y_m", "northing", "northing_m", "north")
_DIAMETERS = {"dbh_m": 100.0, "dbh_cm": 1.0, "dbh": 1.0, "d": 1.0, "diameter_cm": 1.0}
"""Column -> centimetres of its unit."""


@dataclass(frozen=True, slots=True, eq=False)
class StemTable:
    """places_m: (n, 2). dbh_cm: (n,), NaN where it is not given."""

    places_m: Array
    dbh_cm: Array

    @property
    def weights(self) -> Array:
        """(n,) the say of each: thick stems carry the crowns that are seen from above."""
        known = np.isfinite(self.dbh_cm)
        usual = float(np.median(self.dbh_cm[known])) if known.any() else 1.0
        return np.where(known, self.dbh_cm, usual) / usual


def read_stems(path: Path, least_dbh_cm: float = 0.0) -> StemTable:
    """Columns x and y (or easting and northing) in metres; dbh_cm, dbh, d (cm) or dbh_m where known.

    Raises `CloudError` that names the line.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.DictReader(file)
            names = {name.strip().lower(): name for name in rows.fieldnames or []}
            x, y = _column(path, names, _X), _column(path, names, _Y)
            thick = next((name for name in _DIAMETERS if name in names), None)
            found = []
            for number, row in enumerate(rows, start=2):
                dbh = _number(path, number, row[names[thick]]) * _DIAMETERS[thick] if thick else float("nan")
                if not dbh < least_dbh_cm:
                    found.append((_number(path, number, row[x]), _number(path, number, row[y]), dbh))
    except (OSError, UnicodeDecodeError) as error:
        raise CloudError(f"{path}: cannot be read as a table ({error})") from error
    if not found:
        raise CloudError(f"{path}: holds no stems" + (f" of {least_dbh_cm:g} cm and more" if least_dbh_cm else ""))
    table = np.array(found)
    if not np.isfinite(table[:, :2]).all():
        raise CloudError(f"{path}: a stem has no place; every row needs x and y")
    return StemTable(table[:, :2], table[:, 2])


def _column(path: Path, names: dict[str, str], known: tuple[str, ...]) -> str:
    for name in known:
        if name in names:
            return names[name]
    raise CloudError(f"{path}: no column {known[0]}; a table of stems has x and y in metres, and dbh_cm where known")


def _number(path: Path, line: int, text: str | None) -> float:
    if text is None or not text.strip():
        return float("nan")
    try:
        return float(text)
    except ValueError:
        raise CloudError(f"{path}:{line}: {text!r} is no number") from None
