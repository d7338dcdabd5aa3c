"""Trajectories as text: one line a pose, `t x y z qx qy qz qw`, seconds, metres. What `evo` and its relatives read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]


def write_tum(path: Path, stamps_ns: npt.NDArray[np.int64], positions_m: Array, rotations: Array) -> None:
    """stamps_ns: (n,). positions_m: (n, 3). rotations: (n, 3, 3)."""
    quaternions = Rotation.from_matrix(rotations).as_quat() if len(rotations) else np.empty((0, 4))
    with path.open("w", encoding="ascii") as file:
        for stamp, p, q in zip(stamps_ns.tolist(), positions_m.tolist(), quaternions.tolist(), strict=True):
            # Whole and fraction apart: a double has no nanoseconds left at today's epoch.
            seconds, rest = divmod(stamp, 1_000_000_000)
            numbers = " ".join(f"{value:.6f}" for value in p) + " " + " ".join(f"{value:.9f}" for value in q)
            file.write(f"{seconds}.{rest:09d} {numbers}\n")
