"""What an alignment comes to, as JSON."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np

from pipeline.alignment.errors import CloudError
from pipeline.alignment.task import Done
from pipeline.alignment.transform import Transform

ALIGNED, NOT_ENOUGH = "aligned", "not enough to tell"
FILE = "alignment.json"
MOST_TILT_DEG = 1.0


class Rival(msgspec.Struct, frozen=True):
    """The best other answer, relative to the one given."""

    away_m: float
    away_deg: float
    nats: float


class Result(msgspec.Struct, frozen=True):
    """transform: turn by yaw_deg counter-clockwise about the pivot, then shift; matrix: the same, (4, 4) by rows.

    It takes the coordinates that `applies_to` names to those of the aerial map. covariance: (4, 4) by rows of x, y, z
    (m) and yaw (rad) at the pivot; null where z is not known.
    """

    verdict: str
    doubts: list[str]
    notes: list[str]
    aerial: str
    terrestrial: str
    crs: str
    applies_to: str
    pivot_m: tuple[float, float]
    x_m: float
    y_m: float
    z_m: float | None
    yaw_deg: float
    matrix: list[list[float]]
    sigma_m: float
    sigma_z_m: float | None
    sigma_deg: float
    covariance: list[list[float | None]]
    tilt_deg: float | None
    margin_nats: float
    asked_nats: float
    rival: Rival | None
    nats: dict[str, float]
    overlap: float
    stems: int
    method: str
    cell_m: float
    version: str

    @property
    def transform(self) -> Transform:
        """As applied."""
        return Transform(self.pivot_m, self.x_m, self.y_m, self.z_m or 0.0, self.yaw_deg)


def result(done: Done, version: str) -> Result:
    """Of what was found."""
    found, placed = done.alignment, done.placed
    covariance = found.covariance
    whole = total(done)
    crs = placed.fixed_crs
    rival = found.rival
    return Result(
        verdict=ALIGNED if found.sure else NOT_ENOUGH,
        doubts=list(found.doubts),
        notes=[*placed.notes, *_tilted(done)],
        aerial=str(done.aerial.path),
        terrestrial=str(placed.cloud.path),
        crs=crs.to_wkt() if crs is not None else "",
        applies_to="the terrestrial file, as it is"
        if _untouched(done)
        else f"the terrestrial file in {crs_name(done)}",
        pivot_m=whole.pivot_m,
        x_m=whole.x_m,
        y_m=whole.y_m,
        z_m=whole.z_m if found.vertical else None,
        yaw_deg=whole.yaw_deg,
        matrix=whole.matrix().tolist(),
        sigma_m=float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1])),
        sigma_z_m=found.vertical.sigma_m if found.vertical else None,
        sigma_deg=math.degrees(math.sqrt(covariance[3, 3])),
        covariance=[[value if math.isfinite(value) else None for value in row] for row in covariance.tolist()],
        tilt_deg=found.vertical.tilt_deg if found.vertical else None,
        margin_nats=found.margin_nats,
        asked_nats=found.asked_nats,
        rival=_rival(done) if rival is not None else None,
        nats={share.name: share.nats for share in found.shares},
        overlap=found.overlap,
        stems=0 if done.moved.stems_m is None else len(done.moved.stems_m),
        method=done.config.method,
        cell_m=done.config.cell_m,
        version=version,
    )


def total(done: Done) -> Transform:
    """From the terrestrial file, once it is in the aerial map's coordinate system, or from its local frame."""
    start = done.placed.start
    return done.alignment.transform if start is None else done.alignment.transform.after(start)


def crs_name(done: Done) -> str:
    """Of the aerial map."""
    return done.placed.fixed_crs.name if done.placed.fixed_crs is not None else "unnamed coordinates"


def write_result(path: Path, found: Result) -> None:
    """For programs, and for people who read JSON."""
    path.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n")


def read_result(path: Path) -> Result:
    """From the file or the folder that holds it."""
    file = path / FILE if path.is_dir() else path
    try:
        return msgspec.json.decode(file.read_bytes(), type=Result)
    except OSError as error:
        raise CloudError(f"{file}: cannot be read ({error.strerror}); give what `mapforest align` wrote") from error
    except msgspec.MsgspecError as error:
        raise CloudError(f"{file}: not what `mapforest align` writes ({error})") from error


def _untouched(done: Done) -> bool:
    crs = done.placed.cloud.crs
    return done.placed.start is not None or crs is None or done.placed.fixed_crs is None or not done.placed.converted


def _rival(done: Done) -> Rival:
    found = done.alignment
    assert found.rival is not None
    at = found.transform
    away = math.hypot(found.rival.x_m - at.x_m, found.rival.y_m - at.y_m)
    return Rival(away, abs((found.rival.yaw_deg - at.yaw_deg + 180.0) % 360.0 - 180.0), found.rival.nats)


def _tilted(done: Done) -> list[str]:
    vertical = done.alignment.vertical
    if vertical is None:
        return ["nothing tells heights: the map is not shifted up or down"]
    if vertical.tilt_deg > MOST_TILT_DEG:
        return [f"the grounds are tilted against each other by {vertical.tilt_deg:.1f} degrees: is the map level?"]
    return []
