"""All estimates of a session, on the disk as they are made and in memory as arrays (1 kB a sweep, 70 MB for 2 h)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np
import numpy.typing as npt

from pipeline.estimates import OdometryEstimate

Array = npt.NDArray[np.float64]
_NOTE = "S160"
ESTIMATE = np.dtype(
    [
        ("stamp_ns", "<i8"),
        ("position_m", "<f8", 3),
        ("rotation", "<f8", (3, 3)),
        ("velocity_m_s", "<f8", 3),
        ("covariance", "<f8", (6, 6)),
        ("gyro_bias", "<f8", 3),
        ("accel_bias", "<f8", 3),
        ("travelled_m", "<f8"),
        ("degenerate", "?"),
        ("weak", "u1"),
        ("weak_directions", "<f8", (3, 3)),
        ("points", "<i4"),
        ("matches", "<i4"),
        ("note", _NOTE),
    ]
)
"""One `OdometryEstimate`; the first `weak` rows of weak_directions are meant."""


class TrackWriter:
    """Appends estimates to a file; a context manager."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")

    def __enter__(self) -> TrackWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._file.close()

    def add(self, estimate: OdometryEstimate) -> None:
        """In order of time."""
        self._file.write(record_of(estimate).tobytes())


def record_of(estimate: OdometryEstimate) -> npt.NDArray[np.void]:
    """(1,) of ESTIMATE."""
    record = np.zeros(1, ESTIMATE)
    for name in ESTIMATE.names or ():
        if name not in ("weak", "weak_directions", "note"):
            record[name] = getattr(estimate, name)
    weak = np.asarray(estimate.weak_directions, dtype=np.float64).reshape(-1, 3)[:3]
    record["weak"] = len(weak)
    record["weak_directions"][0, : len(weak)] = weak
    record["note"] = estimate.note.encode()[:160]
    return record


def read_track(path: Path) -> npt.NDArray[np.void]:
    """(n,) of ESTIMATE; a record that was cut off is left out."""
    size = path.stat().st_size // ESTIMATE.itemsize
    return np.fromfile(path, ESTIMATE, size)


def estimate_of(record: npt.NDArray[np.void] | np.void) -> OdometryEstimate:
    """Back from one record."""
    return OdometryEstimate(
        stamp_ns=int(record["stamp_ns"]),
        position_m=record["position_m"],
        rotation=record["rotation"],
        velocity_m_s=record["velocity_m_s"],
        covariance=record["covariance"],
        gyro_bias=record["gyro_bias"],
        accel_bias=record["accel_bias"],
        travelled_m=float(record["travelled_m"]),
        degenerate=bool(record["degenerate"]),
        weak_directions=record["weak_directions"][: int(record["weak"])],
        points=int(record["points"]),
        matches=int(record["matches"]),
        note=bytes(record["note"]).decode(errors="replace"),
    )


@dataclass(frozen=True, slots=True)
class Placement:
    """`odom` at each estimate of a track in `map`, or in `local`: p = rotation @ p_odom + translation_m.

    datum: latitude, longitude (degrees), ellipsoidal height (m) of the origin of `map`; None: nothing tells where on
    the Earth it is, and the frame is `local`. translation_m: (n, 3). rotation: (n, 3, 3). covariance: (n, 6, 6) of
    `base_link` there: position, then rotation.
    """

    datum: tuple[float, float, float] | None
    translation_m: Array
    rotation: Array
    covariance: Array

    @classmethod
    def upright(
        cls, datum: tuple[float, float, float] | None, translation_m: Array, yaw_rad: Array, covariance: Array
    ) -> Placement:
        """Of headings (n,) alone."""
        turn = np.zeros((len(yaw_rad), 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(yaw_rad)
        turn[:, 1, 0] = np.sin(yaw_rad)
        turn[:, 0, 1] = -turn[:, 1, 0]
        turn[:, 2, 2] = 1.0
        return cls(datum, translation_m, turn, covariance)

    @property
    def frame(self) -> str:
        """`map` (ENU at the datum) or `local`."""
        return "local" if self.datum is None else "map"

    def points(self, odom_m: Array, sweeps: npt.NDArray[np.integer]) -> Array:
        """(m, 3) points in `odom` -> in the frame, each by the placement of its sweep (m,)."""
        return np.asarray(np.einsum("mij,mj->mi", self.rotation[sweeps], odom_m) + self.translation_m[sweeps])

    def poses(self, track: npt.NDArray[np.void]) -> tuple[Array, Array]:
        """Positions (n, 3) and rotations (n, 3, 3) of a track in the frame."""
        return self.points(track["position_m"], np.arange(len(track))), self.rotation @ track["rotation"]
