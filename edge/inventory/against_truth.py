"""Measured stems of a session against the forest that the emulated payload was carried through, or a field list."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from edge.errors import EdgeError, FormatError
from edge.inventory.maps import FOLDER
from edge.process.against_truth import products_folder, simulated_way
from edge.process.product_facts import read_facts
from pipeline.evaluation.diameters import Diameters
from pipeline.evaluation.trajectory import Trajectory, read_tum
from pipeline.inventory.errors import InventoryError
from pipeline.inventory.field_list import read_field_list
from pipeline.products.earth import Site

Array = npt.NDArray[np.float64]
TREES = "trees.csv"
WITHIN_M, LEAST_M = 15.0, 0.10
"""Of the way, and as thick: what should be found of a simulated forest."""
BESIDE_M = 10.0
"""A stem is put to the truth as the way is around it, with this sigma."""


def read_diameters(estimate: Path, truth: Path) -> Diameters:
    """estimate: a session, a folder of `mapforest inventory`, or its table. truth: a field list in the same
    coordinates; of a session also the folder that the emulated payload wrote. FormatError, EdgeError name the file."""
    measured = _measured(estimate)
    if truth.is_dir():
        return _simulated(estimate, truth, measured)
    try:
        taped = read_field_list(truth).on_map(None)
    except InventoryError as error:
        raise EdgeError(str(error)) from error
    at = np.array([[one.x_m, one.y_m] for one in taped])
    dbh = np.array([one.dbh_m for one in taped])
    return Diameters(*measured, at, dbh, np.ones(len(dbh), np.bool_))


def _measured(estimate: Path) -> tuple[Array, Array, Array]:
    """Places (n, 2), diameters (n,) and their sigmas (n,), without what an analyst added."""
    tables = [estimate / TREES, estimate / FOLDER / TREES, estimate / "products" / FOLDER / TREES]
    table = next((path for path in tables if path.exists()), tables[0]) if estimate.is_dir() else estimate
    try:
        with table.open(encoding="utf-8-sig", newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["status"] != "added"]
        figures = np.array([[float(row[k] or "nan") for k in ("x", "y", "dbh_cm", "dbh_sd_cm")] for row in rows])
    except (OSError, KeyError, ValueError) as error:
        raise FormatError(
            f"{table}: not what `mapforest inventory` writes ({error!r}); run it on {estimate} first"
        ) from error
    figures = figures.reshape(-1, 4)
    return figures[:, :2], figures[:, 2] / 100.0, figures[:, 3] / 100.0


def _simulated(session: Path, truth: Path, measured: tuple[Array, Array, Array]) -> Diameters:
    """In the world's frame, with the error of the trajectory around each stem taken off."""
    products = products_folder(session)
    facts = read_facts(products)
    places, dbh, sigma = measured
    if facts.datum is not None:
        places = Site(facts.datum).from_utm(places)
    true = simulated_way(truth, facts)
    try:
        said = read_tum(products / facts.trajectory).within(true)
    except ValueError as error:
        raise FormatError(f"{products} against {truth}: {error}") from error
    true = true.at(said.stamps_ns)
    places = _beside(places, said, true)
    way = cKDTree(true.positions_m[:, :2])
    stood, true_dbh = read_true_stems(truth)
    near = way.query(places)[0] <= WITHIN_M
    wanted = (way.query(stood)[0] <= WITHIN_M) & (true_dbh >= LEAST_M)
    return Diameters(places[near], dbh[near], sigma[near], stood, true_dbh, wanted)


def read_true_stems(truth: Path) -> tuple[Array, Array]:
    """Feet (n, 2) in the simulated world, and diameters (n,)."""
    path = truth / "stems.csv"
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = np.array([[float(row[k]) for k in ("east_m", "north_m", "dbh_m")] for row in csv.DictReader(file)])
    except (OSError, KeyError, ValueError) as error:
        raise FormatError(f"{path}: not what the emulated payload writes ({error!r})") from error
    rows = rows.reshape(-1, 3)
    return rows[:, :2], rows[:, 2]


def _beside(places_m: Array, said: Trajectory, true: Trajectory) -> Array:
    """Each place (n, 2) moved as the way around it has to be to lie on the true one, in plan."""
    have, want = said.positions_m[:, :2], true.positions_m[:, :2]
    out = np.empty_like(places_m)
    for k, place in enumerate(places_m):
        away = ((have - place) ** 2).sum(axis=1)
        weight = np.exp(-0.5 * (away - away.min()) / BESIDE_M**2)
        weight /= weight.sum()
        here, there = weight @ have, weight @ want
        a, b = have - here, want - there
        turn = np.angle((weight * np.conj(a[:, 0] + 1j * a[:, 1]) * (b[:, 0] + 1j * b[:, 1])).sum())
        cosine, sine = np.cos(turn), np.sin(turn)
        out[k] = there + np.array([[cosine, -sine], [sine, cosine]]) @ (place - here)
    return out
