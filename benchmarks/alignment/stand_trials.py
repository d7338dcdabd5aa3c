"""Made-up patches with truth: what can be told, and what must be refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.alignment.peer_trials import peers
from benchmarks.alignment.real_trials import each
from benchmarks.alignment.stands import Stand, from_the_air, from_the_ground, grow, write_las
from benchmarks.alignment.trials import Asked, Case, Trial
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
REFUSED = ("plantation rows, flat", "five trees, flat", "another stand, flat")


def stands(asked: Asked) -> Iterator[Trial]:
    """All patches of one seed after those of another. Peers are not asked where nothing may be found."""
    for k in range(asked.first, asked.first + asked.count):
        seed, (name, (above, below, crowns)) = k // len(PATCHES), list(PATCHES.items())[k % len(PATCHES)]
        air = write_las(asked.folder / "air.laz", from_the_air(above(seed)))
        true = _off(above(seed), seed)
        seen = from_the_ground(below(seed), RADIUS_M, true, crowns=crowns)
        yield from each(asked, Case(name, air, write_las(asked.folder / "ground.laz", seen), true))
        if name not in REFUSED:
            yield from peers(asked, name, air, write_las(asked.folder / "still.laz", true.apply(seen)), [true])


def _off(stand: Stand, seed: int) -> Transform:
    rng = np.random.default_rng([seed, 17])
    x, y = stand.middle_m.tolist()
    east, north, up = rng.uniform(-5, 5, 3).tolist()
    return Transform((x, y), east, north, up, float(rng.uniform(-30, 30)))
