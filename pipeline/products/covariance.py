"""How well each pose is known, over time, as a table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
HEADER = (
    "time_s,frame,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m,sigma_roll_deg,sigma_pitch_deg,sigma_yaw_deg,"
    "travelled_m,degenerate,points,matches"
)


def write_covariance(
    path: Path, frame: str, track: npt.NDArray[np.void], positions_m: Array, covariance: Array
) -> None:
    """A line a pose in `frame` (map or odom). track: (n,) of ESTIMATE; covariance: (n, 6, 6)."""
    sigma = sigmas(covariance)
    sigma[:, 3:] = np.degrees(sigma[:, 3:])
    with path.open("w", encoding="ascii") as file:
        file.write(HEADER + "\n")
        for record, position, one in zip(track, positions_m.tolist(), sigma.tolist(), strict=True):
            seconds, rest = divmod(int(record["stamp_ns"]), 1_000_000_000)
            numbers = [*(f"{value:.4f}" for value in position), *(f"{value:.5f}" for value in one)]
            counts = f"{record['travelled_m']:.3f},{int(record['degenerate'])},{record['points']},{record['matches']}"
            file.write(f"{seconds}.{rest:09d},{frame},{','.join(numbers)},{counts}\n")


def sigmas(covariance: Array) -> Array:
    """(n, 6) roots of the diagonals."""
    return np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))


def horizontal_sigma_m(covariance: Array) -> Array:
    """(n,)."""
    return np.sqrt(np.maximum(covariance[:, 0, 0] + covariance[:, 1, 1], 0.0))
