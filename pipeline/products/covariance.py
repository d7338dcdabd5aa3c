"""How well each pose is known, over time, as a table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
HEADER = (
    "time_s,frame,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m,sigma_roll_deg,sigma_pitch_deg,sigma_yaw_deg,"
    "cov_xy_m2,cov_xz_m2,cov_yz_m2,travelled_m,degenerate,points,matches"
)


def write_covariance(
    path: Path, frame: str, track: npt.NDArray[np.void], positions_m: Array, covariance: Array
) -> None:
    """A line a pose in `frame` (map or odom). track: (n,) of ESTIMATE; covariance: (n, 6, 6)."""
    sigma = sigmas(covariance)
    sigma[:, 3:] = np.degrees(sigma[:, 3:])
    with path.open("w", encoding="ascii") as file:
        file.write(HEADER + "\n")
        mixed = covariance[:, [0, 0, 1], [1, 2, 2]]
        rows = zip(track, positions_m.tolist(), sigma.tolist(), mixed.tolist(), strict=True)
        for record, position, one, off in rows:
            seconds, rest = divmod(int(record["stamp_ns"]), 1_000_000_000)
            numbers = [*(f"{value:.4f}" for value in position), *(f"{value:.6g}" for value in (*one, *off))]
            counts = f"{record['travelled_m']:.3f},{int(record['degenerate'])},{record['points']},{record['matches']}"
            file.write(f"{seconds}.{rest:09d},{frame},{','.join(numbers)},{counts}\n")


def read_covariance(path: Path) -> tuple[npt.NDArray[np.int64], Array]:
    """(n,) stamps in ns and (n, 3, 3) covariances of position. ValueError for another table."""
    lines = path.read_text(encoding="ascii").splitlines()
    if not lines or lines[0] != HEADER:
        raise ValueError(f"{path}: not a table of covariances of this version; process the recording again")
    rows = [line.split(",") for line in lines[1:]]
    stamps = np.array([int(row[0].replace(".", "")) for row in rows], dtype=np.int64)
    values = np.array([[float(row[k]) for k in (5, 6, 7, 11, 12, 13)] for row in rows]).reshape(-1, 6)
    covariance = np.zeros((len(rows), 3, 3))
    for k in range(3):
        covariance[:, k, k] = values[:, k] ** 2
    for (i, j), column in zip(((0, 1), (0, 2), (1, 2)), values.T[3:], strict=True):
        covariance[:, i, j] = covariance[:, j, i] = column
    return stamps, covariance


def sigmas(covariance: Array) -> Array:
    """(n, 6) roots of the diagonals."""
    return np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))


def horizontal_sigma_m(covariance: Array) -> Array:
    """(n,)."""
    return np.sqrt(np.maximum(covariance[:, 0, 0] + covariance[:, 1, 1], 0.0))
