"""Two walks in a made-up stand, each in a frame of its own, brought together by their stems and ground."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.alignment.stands import Kind, Stand, from_the_ground, grow, write_las
from benchmarks.alignment.trials import Asked, Trial
from edge import __version__
from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.errors import AlignmentError
from pipeline.alignment.result import result
from pipeline.alignment.task import Task, run
from pipeline.alignment.transform import Transform, wrapped_deg
from pipeline.evaluation.alignment import AlignmentErrors

RADIUS_M, SIDE_M = 18.0, 110.0
MISSED = 0.1
"""Share of the stems that either walk does not see."""
PAIRS: dict[str, tuple[Kind, float, float]] = {
    "shared by three quarters": ("mixed", 0.6, 7.0),
    "by a half": ("mixed", 0.6, 14.5),
    "by a half, flat": ("mixed", 0.0, 14.5),
    "nothing shared": ("mixed", 0.6, 45.0),
    "nothing shared, flat": ("mixed", 0.0, 45.0),
    "plantation rows, flat": ("rows", 0.0, 7.0),
}
"""Name -> stand, relief in metres, how far apart the middles of two discs of `RADIUS_M` lie."""


def sessions(asked: Asked) -> Iterator[Trial]:
    """All pairs of one seed after those of another."""
    for k in range(asked.first, asked.first + asked.count):
        seed, (name, (kind, relief_m, apart_m)) = k // len(PAIRS), list(PAIRS.items())[k % len(PAIRS)]
        stand = grow(kind, seed, side_m=SIDE_M, relief_m=relief_m)
        yield _trial(name, stand, apart_m, seed, asked.folder)


def _trial(name: str, stand: Stand, apart_m: float, seed: int, folder: Path) -> Trial:
    rng = np.random.default_rng([seed, 19])
    way = rng.uniform(0, 2 * np.pi)
    middle = stand.middle_m + apart_m / 2 * np.array([np.cos(way), np.sin(way)])
    off = [_frame(stand, rng), _frame(stand, rng)]
    paths = []
    for walk, (sign, one) in enumerate(zip((-1, 1), off, strict=True)):
        at = sign * (middle - stand.middle_m)
        seen = from_the_ground(stand, RADIUS_M, one, crowns=False, at_m=tuple(at), walk=walk, missed=MISSED)
        paths.append(write_las(folder / f"{walk}.laz", seen, None))
    cpu = time.process_time()
    try:
        done = run(Task(*paths, AlignmentConfig(), sessions=True), lambda _: lambda _: None)
    except AlignmentError:
        return Trial(name, "ours", None, time.process_time() - cpu)
    cpu = time.process_time() - cpu
    told = result(done, __version__)
    here = off[1].inverse().apply(np.array([[*middle, 0.0]]))
    wrong = (told.transform.apply(here) - off[0].inverse().apply(off[1].apply(here)))[0]
    turn = wrapped_deg(told.yaw_deg - off[1].yaw_deg + off[0].yaw_deg)
    errors = AlignmentErrors(float(np.hypot(*wrong[:2])), float(wrong[2]), turn, float("nan"), told.verdict)
    return Trial(name, "ours", errors, cpu)


def _frame(stand: Stand, rng: np.random.Generator) -> Transform:
    """Local coordinates of odometry -> the stand's."""
    x, y = (stand.middle_m + rng.uniform(-30, 30, 2)).tolist()
    return Transform((0.0, 0.0), x, y, float(rng.uniform(450, 550)), float(rng.uniform(-180, 180)))
