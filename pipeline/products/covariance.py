"""How well each pose is known, over time, as a table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
HEADER = (
    "time_s,frame,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m,sigma_roll_deg,sigma_pitch_deg,sigma_yaw_deg,"
    "cov_xy_m2,cov_xz_m2,cov_yz_m2,travelled_m,degenerate,points,matches"
)


@dataclass(frozen=True, slots=True, eq=False)
class PoseTable:
    """n poses in `frame` (map, local or odom). positions_m: (n, 3). covariance: (n, 6, 6) of position, then rotation;
    of a table that was read, the mixed terms of rotation are zero.
    """

    frame: str
    stamps_ns: npt.NDArray[np.int64]
    positions_m: Array
    covariance: Array
    travelled_m: Array
    degenerate: npt.NDArray[np.bool_]
    points: npt.NDArray[np.int64]
    matches: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def seconds(self) -> Array:
        """(n,) since the first."""
        return np.asarray((self.stamps_ns - self.stamps_ns[:1]) / 1e9)

    @property
    def sigmas(self) -> Array:
        """(n, 6) roots of the diagonals: m, rad."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))

    @property
    def horizontal_sigma_m(self) -> Array:
        """(n,)."""
        return horizontal_sigma_m(self.covariance)

    @property
    def speed_m_s(self) -> Array:
        """(n,) from one pose to the next."""
        if len(self) < 2:
            return np.zeros(len(self))
        steps_m = np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1)
        return np.append(steps_m / np.maximum(np.diff(self.seconds), 1e-3), np.nan)


def pose_table(frame: str, track: npt.NDArray[np.void], positions_m: Array, covariance: Array) -> PoseTable:
    """track: (n,) of ESTIMATE, whose poses lie at positions_m (n, 3) in `frame`."""
    counts = (track["points"].astype(np.int64), track["matches"].astype(np.int64))
    return PoseTable(
        frame, track["stamp_ns"], positions_m, covariance, track["travelled_m"], track["degenerate"], *counts
    )


def write_covariance(path: Path, poses: PoseTable) -> None:
    """A line a pose."""
    sigma = poses.sigmas
    sigma[:, 3:] = np.degrees(sigma[:, 3:])
    mixed = poses.covariance[:, [0, 0, 1], [1, 2, 2]]
    with path.open("w", encoding="ascii") as file:
        file.write(HEADER + "\n")
        for k, (stamp, position) in enumerate(zip(poses.stamps_ns.tolist(), poses.positions_m.tolist(), strict=True)):
            seconds, rest = divmod(stamp, 1_000_000_000)
            numbers = [f"{value:.4f}" for value in position]
            numbers += [f"{value:.6g}" for value in (*sigma[k].tolist(), *mixed[k].tolist())]
            counts = f"{poses.travelled_m[k]:.3f},{int(poses.degenerate[k])},{poses.points[k]},{poses.matches[k]}"
            file.write(f"{seconds}.{rest:09d},{poses.frame},{','.join(numbers)},{counts}\n")


def read_covariance(path: Path) -> PoseTable:
    """What was written. ValueError for another table."""
    lines = path.read_text(encoding="ascii").splitlines()
    if not lines or lines[0] != HEADER:
        raise ValueError(f"{path}: not a table of covariances of this version; process the recording again")
    rows = [line.split(",") for line in lines[1:]]
    stamps = np.array([int(row[0].replace(".", "")) for row in rows], dtype=np.int64)
    values = np.array([[float(cell) for cell in row[2:]] for row in rows]).reshape(-1, 16)
    sigmas, mixed = values[:, 3:9], values[:, 9:12]
    sigmas[:, 3:] = np.radians(sigmas[:, 3:])
    covariance = np.zeros((len(rows), 6, 6))
    covariance[:, range(6), range(6)] = sigmas**2
    for (i, j), column in zip(((0, 1), (0, 2), (1, 2)), mixed.T, strict=True):
        covariance[:, i, j] = covariance[:, j, i] = column
    frame = rows[0][1] if rows else ""
    counts = values[:, 14:16].astype(np.int64).T
    return PoseTable(frame, stamps, values[:, :3], covariance, values[:, 12], values[:, 13] > 0, *counts)


def horizontal_sigma_m(covariance: Array) -> Array:
    """(n,) of (n, 2 or more, 2 or more)."""
    return np.sqrt(np.maximum(covariance[:, 0, 0] + covariance[:, 1, 1], 0.0))
