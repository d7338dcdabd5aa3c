"""How far along its way the payload was, and where, at any time of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from edge.config import Config
from edge.errors import FormatError
from edge.process.process import Task
from edge.process.product_facts import ProductFacts
from edge.replay.poses import read_live_poses
from pipeline.evaluation.trajectory import Trajectory, read_tum
from pipeline.gnss.geodesy import Datum, geodetic

STRIDE_M = 0.1
"""The way is counted in strides of at least this: standing still adds nothing."""
_HOLE_NS = 1_000_000_000
"""Between poses farther apart than this nobody knows the place."""


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """stamps_ns: (n,) rising. travelled_m: (n,). earth: in Earth-centred axes, None without georeference."""

    stamps_ns: npt.NDArray[np.int64]
    travelled_m: npt.NDArray[np.float64]
    earth: Trajectory | None
    origin: str
    """Where the poses are from, in words."""

    def covers(self, stamp_ns: int) -> bool:
        """Whether it is within the way."""
        return bool(self.stamps_ns[0] <= stamp_ns <= self.stamps_ns[-1])

    def along_m(self, stamp_ns: int) -> float:
        """Metres since the start."""
        origin = self.stamps_ns[0]
        return float(np.interp(stamp_ns - origin, self.stamps_ns - origin, self.travelled_m))

    def place(self, stamp_ns: int) -> tuple[float, float, float] | None:
        """Latitude, longitude (degrees) and height (m, ellipsoidal) of `base_link`; None where it is not known."""
        if self.earth is None:
            return None
        stamps = self.earth.stamps_ns
        after = int(np.searchsorted(stamps, stamp_ns))
        if not 0 < after < len(stamps) or stamps[after] - stamps[after - 1] > _HOLE_NS:
            return None
        share = (stamp_ns - stamps[after - 1]) / (stamps[after] - stamps[after - 1])
        before_m, after_m = self.earth.positions_m[after - 1], self.earth.positions_m[after]
        return geodetic(before_m + share * (after_m - before_m))


@dataclass(frozen=True, slots=True)
class NoWay:
    """There are no poses: why, and what would help."""

    why: str


def find_way(targets: Sequence[Path], config: Config) -> Way | NoWay:
    """From the products of a processed session, else from what the live pipeline recorded."""
    products = Task(targets).folder
    if (products / "products.json").exists():
        return _processed(products)
    live = read_live_poses(targets[0], config)
    if live.odom is not None and len(live.odom.stamps_ns) > 1:
        return _way(live.odom, live.earth, "the live odometry in the recording")
    return NoWay(
        f"there are no poses: neither products ({products}) nor live odometry in the recording; "
        f"`mapforest process {' '.join(map(str, targets))}` makes them"
    )


def _processed(products: Path) -> Way:
    try:
        facts = msgspec.json.decode((products / "products.json").read_bytes(), type=ProductFacts)
        odom, earth = read_tum(products / "trajectory_odom.tum"), None
        if facts.datum is not None and (products / "trajectory.tum").exists():
            datum = Datum(*facts.datum)
            earth = read_tum(products / "trajectory.tum").moved(datum.turn, datum.origin_m)
    except (OSError, ValueError, msgspec.MsgspecError) as error:
        raise FormatError(f"{products}: not whole ({error}); run `mapforest process` again") from error
    return _way(odom, earth, str(products / "trajectory_odom.tum"))


def _way(odom: Trajectory, earth: Trajectory | None, origin: str) -> Way:
    return Way(odom.stamps_ns, strides_m(odom.positions_m), earth, origin)


def strides_m(positions_m: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(n,) length of the way up to each position (n, 3), in strides of at least `STRIDE_M`."""
    travelled = np.zeros(len(positions_m))
    stood, total = positions_m[0], 0.0
    for place, position in enumerate(positions_m):
        stride = float(np.linalg.norm(position - stood))
        if stride >= STRIDE_M:
            stood, total = position, total + stride
        travelled[place] = total
    return travelled
