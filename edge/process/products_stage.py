"""Last stage: what is handed out, in the formats that others open."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from drivers.messages import GnssFix
from edge.process import detections_file, fusion_stage, odometry_stage
from edge.process.detections_file import DetectionFacts
from edge.process.fusion_stage import FusionFacts, read_placement
from edge.process.odometry_stage import OdometryFacts, read_fixes
from pipeline.gnss.geodesy import Datum
from pipeline.products.covariance import horizontal_sigma_m, write_covariance
from pipeline.products.earth import Site
from pipeline.products.laz import MapSource, write_laz
from pipeline.products.page import Story, write_page
from pipeline.products.track import Placement, read_track
from pipeline.products.tum import write_tum
from pipeline.products.vector import write_geopackage, write_kml

MADE = (
    "trajectory_odom.tum",
    "trajectory.tum",
    "trajectory.gpkg",
    "trajectory.kml",
    "covariance.csv",
    "trajectory.html",
    "map.laz",
    "map_local.laz",
    "detections.msgpack",
    "products.json",
)
"""Every name this stage may leave behind; those of an earlier run are taken away first."""


class ProductFacts(msgspec.Struct):
    """`products.json`: what is there and what it means."""

    session: str
    frame: str
    """`map` (ENU at the datum) or `odom` (local: from the start, heading arbitrary)."""
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
    detection: DetectionFacts | None = None
    """None where no model was configured."""
    host_offset_ns: int | None = None
    """Session time minus the recording computer's monotonic time; None in recordings of others."""


@dataclass(frozen=True, slots=True)
class ProductsStage:
    """work: the folder of the stages. Files go to `output`, each complete or not at all."""

    work: Path
    output: Path
    voxel_m: float
    session: str
    software: str
    detected: bool = False
    """There is a detection stage's folder."""

    def run(self, advance: Callable[[float], None]) -> ProductFacts:
        """Make everything again."""
        odometry = self.work / "odometry"
        track = read_track(odometry / odometry_stage.TRACK)
        placement = read_placement(self.work / "fusion" / fusion_stage.PLACEMENT)
        done = msgspec.json.decode((odometry / odometry_stage.FACTS).read_bytes(), type=OdometryFacts)
        fused = msgspec.json.decode((self.work / "fusion" / fusion_stage.FACTS).read_bytes(), type=FusionFacts)
        for name in MADE:
            (self.output / name).unlink(missing_ok=True)
        facts = self._facts(track, placement, done, fused)
        self._trajectories(track, placement, facts)
        self._page(track, placement, facts, read_fixes(odometry / odometry_stage.FIXES))
        if self.detected:
            self._detections(facts)
        facts.points = self._map(track, placement, facts, advance)
        with _whole(self.output / "products.json") as path:
            path.write_bytes(msgspec.json.format(msgspec.json.encode(facts), indent=2) + b"\n")
        return facts

    def _facts(
        self, track: npt.NDArray[np.void], placement: Placement | None, done: OdometryFacts, fused: FusionFacts
    ) -> ProductFacts:
        covariance = track["covariance"] if placement is None else placement.covariance
        notes = [*done.notes, *(f"{count} sweeps without an estimate: {why}" for why, count in done.refusals.items())]
        if done.late_scans or done.late_samples:
            notes.append(f"{done.late_scans} sweeps and {done.late_samples} inertial samples came too late, left out")
        if placement is None:
            notes.append(f"not georeferenced: {fused.why}; positions are metres from the start, heading arbitrary")
        said = Counter(note.decode(errors="replace") for note in track["note"] if note)
        notes += [f"{count} sweeps: {note}" for note, count in said.most_common(20)]
        return ProductFacts(
            session=self.session,
            frame="odom" if placement is None else "map",
            crs="local" if placement is None else f"EPSG:{Site(placement.datum).epsg}, ellipsoidal heights",
            datum=fused.datum,
            travelled_m=float(track["travelled_m"][-1]) if len(track) else 0.0,
            duration_s=float(track["stamp_ns"][-1] - track["stamp_ns"][0]) / 1e9 if len(track) else 0.0,
            sweeps=done.sweeps,
            estimates=done.estimates,
            degenerate=done.degenerate,
            sigma_end_m=float(horizontal_sigma_m(covariance[-1:])[0]) if len(track) else 0.0,
            odometry_seconds=done.seconds,
            notes=(*notes, *done.damages),
            software=self.software,
            host_offset_ns=done.host_offset_ns,
        )

    def _trajectories(self, track: npt.NDArray[np.void], placement: Placement | None, facts: ProductFacts) -> None:
        stamps = track["stamp_ns"]
        with _whole(self.output / "trajectory_odom.tum", facts, "base_link in odom: smooth, drifts") as path:
            write_tum(path, stamps, track["position_m"], track["rotation"])
        positions, covariance = track["position_m"], track["covariance"]
        if placement is not None and len(track):
            positions, rotations = placement.poses(track)
            covariance = placement.covariance
            site = Site(placement.datum)
            with _whole(self.output / "trajectory.tum", facts, "base_link in map: ENU at the datum") as path:
                write_tum(path, stamps, positions, rotations)
            with _whole(self.output / "trajectory.gpkg", facts, f"way and poses in EPSG:{site.epsg}") as path:
                write_geopackage(path, site, stamps, positions, _columns(track, covariance))
            with _whole(self.output / "trajectory.kml", facts, "the way, for Google Earth") as path:
                write_kml(path, site, self.session, stamps, positions)
        with _whole(self.output / "covariance.csv", facts, f"sigmas of every pose in {facts.frame}") as path:
            write_covariance(path, facts.frame, track, positions, covariance)

    def _page(
        self, track: npt.NDArray[np.void], placement: Placement | None, facts: ProductFacts, fixes: list[GnssFix]
    ) -> None:
        positions, covariance = track["position_m"], track["covariance"]
        fixes_m = np.empty((0, 3))
        if placement is not None:
            positions, _ = placement.poses(track)
            covariance = placement.covariance
            datum = Datum(*placement.datum)
            fixes_m = np.array([datum.enu(fix.latitude_deg, fix.longitude_deg, fix.height_m) for fix in fixes])
        shown = {
            "travelled": f"{facts.travelled_m:,.1f} m",
            "duration": f"{facts.duration_s:,.0f} s",
            "sweeps": f"{facts.estimates:,} of {facts.sweeps:,}",
            "degenerate": f"{facts.degenerate / max(facts.estimates, 1):.1%}",
            "sigma at the end": f"{facts.sigma_end_m:.2f} m",
            "frame": facts.crs,
        }
        story = Story(
            f"Trajectory of {self.session}",
            facts.frame,
            track,
            positions,
            covariance,
            fixes,
            fixes_m.reshape(-1, 3),
            shown,
            facts.notes,
        )
        with _whole(self.output / "trajectory.html", facts, "plots, readable offline") as path:
            write_page(path, story)

    def _detections(self, facts: ProductFacts) -> None:
        folder = self.work / "detection"
        found = msgspec.json.decode((folder / detections_file.FACTS).read_bytes(), type=DetectionFacts)
        model = found.model
        who = f"detector {model.name} (sha256 {model.sha256[:12]}) on {model.device}"
        facts.detection = found
        facts.notes += (f"{who}: {found.boxes} boxes in {found.images} images", *found.notes)
        with _whole(self.output / detections_file.DETECTIONS, facts, "boxes in images, by stamp, as msgpack") as path:
            shutil.copyfile(folder / detections_file.DETECTIONS, path)

    def _map(
        self,
        track: npt.NDArray[np.void],
        placement: Placement | None,
        facts: ProductFacts,
        advance: Callable[[float], None],
    ) -> int:
        covariance = track["covariance"] if placement is None else placement.covariance
        tiles = self.work / "odometry" / odometry_stage.TILES
        source = MapSource(
            tiles, self.voxel_m, track["stamp_ns"], horizontal_sigma_m(covariance), placement, self.session
        )
        name = "map_local.laz" if placement is None else "map.laz"
        with _whole(self.output / name, facts, f"points in {facts.crs}") as path:
            return write_laz(path, source, advance)


def _columns(track: npt.NDArray[np.void], covariance: npt.NDArray[np.float64]) -> dict[str, npt.NDArray[np.float64]]:
    return {
        "travelled_m": track["travelled_m"],
        "speed_m_s": np.linalg.norm(track["velocity_m_s"], axis=1),
        "sigma_horizontal_m": horizontal_sigma_m(covariance),
        "sigma_vertical_m": np.sqrt(np.maximum(covariance[:, 2, 2], 0.0)),
        "degenerate": track["degenerate"].astype(np.float64),
    }


@contextmanager
def _whole(path: Path, facts: ProductFacts | None = None, meaning: str = "") -> Iterator[Path]:
    """A draft beside the file, put in its place when all is written."""
    draft = path.with_name(f".draft-{path.name}")
    draft.unlink(missing_ok=True)
    yield draft
    draft.replace(path)
    if facts is not None:
        facts.files[path.name] = meaning
