"""Real plots, ours beside dendromatics: who is found, who gets a diameter, and how far the two agree.

Nobody taped these trees: where the two differ, this does not tell who is right.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import laspy
import numpy as np
import numpy.typing as npt

from pipeline.evaluation.diameters import Diameters, paired
from pipeline.inventory.config import InventoryConfig
from pipeline.inventory.inventory import take_inventory
from pipeline.inventory.map_file import open_map

Array = npt.NDArray[np.float64]
PLOTS = ("pine_plot_tls.laz", "fort_valley_mls.laz")
SETTINGS = ("defaults", "6 cm", "10 cm")
"""Of dendromatics: voxels of its clusters."""
HEAD = (
    "| plot | program | stems | with a diameter | of ours | both diameters | bias cm | RMSE cm |\n"
    "|---|---|---|---|---|---|---|---|"
)
ROW = "| {} | {} | {} | {} | {} | {} | {} | {} |"


def rows(data: Path, python: Path) -> Iterator[str]:
    """data: folder with the plots. python: of an environment with dendromatics."""
    yield HEAD
    for name in PLOTS:
        ours = _ours(data / name)
        yield ROW.format(name, "ours", len(ours), int(np.isfinite(ours[:, 2]).sum()), "", "", "", "")
        for setting in SETTINGS:
            told = _theirs(python, data / name, setting)
            if isinstance(told, str):
                yield ROW.format(name, f"dendromatics, {setting}", told, "", "", "", "", "")
            else:
                yield ROW.format(name, f"dendromatics, {setting}", *compared(ours, told))


def compared(ours: Array, theirs: Array) -> tuple[str, ...]:
    """Of stems (n, 3) x, y and diameter, NaN without: counts, and theirs less ours."""
    one = np.ones(len(ours), np.bool_)
    pairs = paired(Diameters(theirs[:, :2], theirs[:, 2], theirs[:, 2], ours[:, :2], ours[:, 2], one))
    apart = theirs[pairs[0], 2] - ours[pairs[1], 2]
    apart = 100.0 * apart[np.isfinite(apart)]
    figures = (f"{apart.mean():+.1f}", f"{np.sqrt((apart**2).mean()):.1f}") if len(apart) else ("", "")
    counts = (len(theirs), int(np.isfinite(theirs[:, 2]).sum()), len(pairs[0]), len(apart))
    return (*map(str, counts), *figures)


def _ours(path: Path) -> Array:
    source = open_map(path)
    found = take_inventory(source, InventoryConfig())
    bases = source.placed(np.array([stem.base_m for stem in found.stems]).reshape(-1, 3))
    return np.column_stack([bases[:, :2], [stem.dbh_m for stem in found.stems]])


def _theirs(python: Path, path: Path, setting: str) -> Array | str:
    """What it finds, or the error that it ends with."""
    xyz = laspy.read(path).xyz
    origin = np.floor(xyz.min(axis=0))
    script = Path(__file__).with_name("run_dendromatics.py")
    with tempfile.TemporaryDirectory() as folder:
        np.save(Path(folder) / "cloud.npy", xyz - origin)
        done = subprocess.run(
            [python, script, Path(folder) / "cloud.npy", setting], capture_output=True, text=True, check=True
        )
    told = json.loads(done.stdout.splitlines()[-1])
    if "error" in told:
        return str(told["error"]).partition(".")[0]
    stems = np.array([[x, y, np.nan if dbh is None else dbh] for x, y, dbh in told["stems"]]).reshape(-1, 3)
    stems[:, :2] += origin[:2]
    return stems
