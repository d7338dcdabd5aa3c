"""`products.json`: what is there and what it means; and the folder that it speaks of."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec

from edge.errors import FormatError
from edge.process.detections_file import DetectionFacts

PRODUCTS_JSON = "products.json"
REPORT = "report.html"
"""Made from the products by another command."""


class Georeference(msgspec.Struct, frozen=True):
    """How `map` lies on the Earth."""

    latitude_deg: float
    """Of the datum, the origin of `map`; WGS 84, as far as the receiver's corrections are: those of a national network
    are in the frame of that network (NAD 83, ETRS89), which may be a metre or two away."""
    longitude_deg: float
    height_m: float
    """Above the ellipsoid."""
    epsg: int
    """Of easting and northing."""
    convergence_deg: float
    """Bearing of grid north, clockwise from true north, which `map` has as its second axis."""
    scale: float
    """Metres of the grid for one on the ellipsoid."""
    heights: str
    undulation_m: float | None
    """Of the geoid above the ellipsoid; None: not known, and so no orthometric heights."""


class FindingFacts(msgspec.Struct, frozen=True):
    """What became of the detections, as far as a machine can say."""

    model: str
    model_sha256: str
    demonstration: bool
    """The model learned from simulated images: what it says of real ones means nothing."""
    images: int
    trees: int
    patches: int
    infested_m2: float
    searched_m2: float
    warning: str


class ProductFacts(msgspec.Struct):
    """`products.json`."""

    session: str
    frame: str
    """`map` (ENU at the datum), `odom` (from the start, heading arbitrary), or `local` (that, refined)."""
    crs: str
    files: dict[str, str] = {}
    """Name -> what it is."""
    datum: tuple[float, float, float] | None = None
    """Latitude, longitude (degrees, WGS 84), ellipsoidal height (m) of the origin of `map`."""
    travelled_m: float = 0.0
    duration_s: float = 0.0
    sweeps: int = 0
    estimates: int = 0
    degenerate: int = 0
    points: int = 0
    sigma_end_m: float = 0.0
    """Horizontal, of the last pose in `frame`."""
    odometry_seconds: float = 0.0
    notes: tuple[str, ...] = ()
    software: str = ""
    host_offset_ns: int | None = None
    """Session time minus the recording computer's monotonic time; None in recordings of others."""
    georeference: Georeference | None = None
    detection: DetectionFacts | None = None
    """None where no model was configured; so with the findings."""
    findings: FindingFacts | None = None

    @property
    def trajectory(self) -> str:
        """The file with the poses in `frame`."""
        return _TRAJECTORIES.get(self.frame, "trajectory_odom.tum")


_TRAJECTORIES = {"map": "trajectory.tum", "local": "trajectory_local.tum"}


def read_facts(folder: Path) -> ProductFacts:
    """Of a folder of products. FormatError when there is no `products.json` of this version."""
    path = folder / PRODUCTS_JSON
    try:
        return msgspec.json.decode(path.read_bytes(), type=ProductFacts)
    except (OSError, msgspec.MsgspecError) as error:
        raise FormatError(f"{path}: not what `mapforest process` writes ({error}); process the recording") from error


@dataclass(frozen=True, slots=True)
class Shelf:
    """Where products go. Each appears complete or not at all, and is told in the facts."""

    folder: Path
    facts: ProductFacts

    @contextmanager
    def put(self, name: str, meaning: str) -> Iterator[Path]:
        """A draft beside the file, put in its place when all is written."""
        with whole(self.folder / name) as draft:
            yield draft
        self.facts.files[name] = meaning


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A draft beside the file, put in its place when all is written."""
    draft = path.with_name(f".draft-{path.name}")
    draft.unlink(missing_ok=True)
    yield draft
    draft.replace(path)
