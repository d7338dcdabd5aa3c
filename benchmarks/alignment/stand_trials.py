"""Made-up patches with truth: what can be told, and what must be refused."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.alignment.stands import Stand, from_the_air, from_the_ground, grow, write_las
from benchmarks.alignment.trials import OURS, Trial, ours, table
from pipeline.alignment.transform import Transform

RADIUS_M, SIDE_M = 20.0, 90.0


def _mixed(seed: int, per_ha: float, relief_m: float = 0.6) -> Stand:
    return grow("mixed", seed, side_m=SIDE_M, per_ha=per_ha, relief_m=relief_m)


def _rows(seed: int) -> Stand:
    return grow("rows", seed, side_m=SIDE_M, relief_m=0.0)


PATCHES: dict[str, tuple[Callable[[int], Stand], Callable[[int], Stand], bool]] = {
    "open, 250 a hectare": (lambda k: _mixed(k, 250.0), lambda k: _mixed(k, 250.0), False),
    "middling, 500": (lambda k: _mixed(k, 500.0), lambda k: _mixed(k, 500.0), False),
    "dense, 900": (lambda k: _mixed(k, 900.0), lambda k: _mixed(k, 900.0), False),
    "dense, 900, crowns seen": (lambda k: _mixed(k, 900.0), lambda k: _mixed(k, 900.0), True),
    "plantation rows, flat": (_rows, _rows, False),
    "five trees, flat": (lambda k: _mixed(k, 30.0, 0.0), lambda k: _mixed(k, 30.0, 0.0), False),
    "another stand, flat": (lambda k: _mixed(k, 500.0, 0.0), lambda k: _mixed(k + 100, 500.0, 0.0), False),
}
"""Name -> what flies over, what is walked in, whether crowns are seen from the ground."""


def run(seeds: int) -> str:
    """A table a patch."""
    parts = []
    for name, (above, below, crowns) in PATCHES.items():
        trials = [one for seed in range(seeds) for one in _both(above(seed), below(seed), seed, crowns)]
        parts.append(f"{name}\n\n{table(trials)}\n")
        print(parts[-1], flush=True)
    return ""


def _both(above: Stand, below: Stand, seed: int, crowns: bool) -> list[Trial]:
    rng = np.random.default_rng([seed, 17])
    x, y = above.middle_m.tolist()
    shift, turn = rng.uniform(-5, 5, 3), float(rng.uniform(-30, 30))
    true = Transform((x, y), float(shift[0]), float(shift[1]), float(shift[2]), turn)
    with tempfile.TemporaryDirectory() as folder:
        air = write_las(Path(folder) / "air.laz", from_the_air(above))
        ground = write_las(Path(folder) / "ground.laz", from_the_ground(below, RADIUS_M, true, crowns=crowns))
        return [ours(method, air, ground, true) for method in list(OURS)[:2]]
