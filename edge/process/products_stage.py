"""Last stage: what is handed out, in the formats that others open."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from drivers.messages import GnssFix
from edge.config import Products
from edge.process import detections_file, fusion_stage, odometry_stage
from edge.process.detections_file import DetectionFacts
from edge.process.finding_files import PICTURES, keep_verified, write_finding_files
from edge.process.findings import read_grounding
from edge.process.fusion_stage import FusionFacts, read_placement
from edge.process.moving_stage import read_moved
from edge.process.odometry_stage import OdometryFacts, read_fixes
from edge.process.places import Places
from edge.process.product_facts import PRODUCTS_JSON, REPORT, Georeference, ProductFacts, Shelf, whole
from edge.process.way_files import Walk, write_way_files
from pipeline.products.covariance import pose_table
from pipeline.products.earth import Site
from pipeline.products.findings import Findings
from pipeline.products.geoid import Geoid, constant_geoid, receiver_geoid
from pipeline.products.handout import Handout
from pipeline.products.laz import MapSource, write_laz
from pipeline.products.occurrences import Survey
from pipeline.products.track import Placement, read_track

MADE = (
    "trajectory_odom.tum",
    "trajectory.tum",
    "trajectory_local.tum",
    "trajectory.gpkg",
    "trajectory.kml",
    "covariance.csv",
    "gnss.csv",
    "trajectory.html",
    "map.laz",
    "map_local.laz",
    "detections.msgpack",
    "findings.gpkg",
    "detections.geojson",
    "detections.qml",
    "findings.kml",
    "findings.kmz",
    "findings_imapinvasives.csv",
    "findings_darwin_core.csv",
    "findings_local.gpkg",
    "findings_local.csv",
    "evidence.tif",
    "evidence.qml",
    PRODUCTS_JSON,
    REPORT,
)
"""Every file this stage may leave behind, and what was made from them: taken away before they are made anew."""


@dataclass(frozen=True, slots=True)
class ProductsStage:
    """Files go to `output`, each complete or not at all.

    findings: None when no detector looked at the images; they are handed out also when it found nothing.
    """

    places: Places
    output: Path
    config: Products
    session: str
    software: str
    findings: Findings | None = None

    def run(self, advance: Callable[[float], None]) -> ProductFacts:
        """Make everything again."""
        odometry = self.places.odometry
        track = read_track(odometry / odometry_stage.TRACK)
        placement = read_placement(self.places.fusion / fusion_stage.PLACEMENT)
        done = msgspec.json.decode((odometry / odometry_stage.FACTS).read_bytes(), type=OdometryFacts)
        fused = msgspec.json.decode((self.places.fusion / fusion_stage.FACTS).read_bytes(), type=FusionFacts)
        kept = keep_verified(self.output)
        self._clear()
        walk = self._walk(track, placement, done, read_fixes(odometry / odometry_stage.FIXES))
        shelf = Shelf(self.output, self._facts(walk, done, fused))
        shelf.facts.notes = (*kept, *shelf.facts.notes)
        write_way_files(shelf, walk)
        if self.findings is not None:
            self._detections(shelf)
            write_finding_files(shelf, Handout.of(self.findings, walk.survey, self.config.patch_gap_m), walk)
        self._map(shelf, walk, advance)
        with whole(self.output / PRODUCTS_JSON) as path:
            path.write_bytes(msgspec.json.format(msgspec.json.encode(shelf.facts), indent=2) + b"\n")
        return shelf.facts

    def _clear(self) -> None:
        for name in MADE:
            (self.output / name).unlink(missing_ok=True)
        shutil.rmtree(self.output / PICTURES, ignore_errors=True)

    def _walk(
        self, track: npt.NDArray[np.void], placement: Placement | None, done: OdometryFacts, fixes: list[GnssFix]
    ) -> Walk:
        positions, covariance, site = track["position_m"], track["covariance"], None
        if placement is not None:
            positions, _ = placement.poses(track)
            covariance, site = placement.covariance, Site(placement.datum) if placement.datum is not None else None
        poses = pose_table("odom" if placement is None else placement.frame, track, positions, covariance)
        observer = self.config.observer or done.operator
        survey = Survey(
            self.session, observer, self.config.organization, track["stamp_ns"], positions, site, self._geoid(fixes)
        )
        return Walk(track, placement, poses, survey, fixes)

    def _geoid(self, fixes: list[GnssFix]) -> Geoid:
        asked = self.config.geoid
        if asked == "receiver":
            return receiver_geoid(fixes)
        return Geoid(np.nan, "not asked for") if asked == "none" else constant_geoid(asked)

    def _facts(self, walk: Walk, done: OdometryFacts, fused: FusionFacts) -> ProductFacts:
        poses, site = walk.poses, walk.survey.site
        notes = [*done.notes, *(f"{count} sweeps without an estimate: {why}" for why, count in done.refusals.items())]
        if done.late_scans or done.late_samples:
            notes.append(f"{done.late_scans} sweeps and {done.late_samples} inertial samples came too late, left out")
        if site is None:
            notes.append(f"not georeferenced: {fused.why}; positions are metres from {_origin(walk)}")
        notes += fused.notes
        said = Counter(note.decode(errors="replace") for note in walk.track["note"] if note)
        notes += [f"{count} sweeps: {note}" for note, count in said.most_common(20)]
        return ProductFacts(
            session=self.session,
            frame=poses.frame,
            crs="local" if site is None else f"EPSG:{site.epsg}, ellipsoidal heights",
            datum=fused.datum,
            travelled_m=float(poses.travelled_m[-1]) if len(poses) else 0.0,
            duration_s=float(poses.seconds[-1]) if len(poses) else 0.0,
            sweeps=done.sweeps,
            estimates=done.estimates,
            degenerate=done.degenerate,
            sigma_end_m=float(poses.horizontal_sigma_m[-1]) if len(poses) else 0.0,
            odometry_seconds=done.seconds,
            notes=(*notes, *done.damages),
            software=self.software,
            host_offset_ns=done.host_offset_ns,
            georeference=None if site is None else _georeference(site, walk.survey.geoid),
        )

    def _detections(self, shelf: Shelf) -> None:
        folder, facts = self.places.detection, shelf.facts
        found = msgspec.json.decode((folder / detections_file.FACTS).read_bytes(), type=DetectionFacts)
        model = found.model
        who = f"detector {model.name} (sha256 {model.sha256[:12]}) on {model.device}"
        facts.detection = found
        boxes = f"{who}: {found.boxes} boxes in {found.images} images"
        facts.notes += (boxes, *found.notes, *read_grounding(self.places).notes)
        with shelf.put(detections_file.DETECTIONS, "boxes in images, by stamp, as msgpack") as path:
            shutil.copyfile(folder / detections_file.DETECTIONS, path)

    def _map(self, shelf: Shelf, walk: Walk, advance: Callable[[float], None]) -> None:
        source = MapSource(
            self.places.odometry / odometry_stage.TILES,
            self.config.voxel_m,
            walk.poses.stamps_ns,
            walk.poses.horizontal_sigma_m,
            walk.placement,
            self.session,
            walk.survey.geoid.words,
            self.findings.evidence if self.findings is not None else None,
            moved=read_moved(self.places.moved),
        )
        if source.moved is not None and (count := sum(int(mask.sum()) for mask in source.moved.values())):
            shelf.facts.notes += (f"{count:,} points of what moved are left out of the map (refinement.moving)",)
        name = "map_local.laz" if walk.survey.site is None else "map.laz"
        with shelf.put(name, f"points in {shelf.facts.crs}") as path:
            shelf.facts.points = write_laz(path, [source], advance)


def _origin(walk: Walk) -> str:
    start = "the start, heading arbitrary"
    return start if walk.placement is None else f"{start}, on the refined way (`local`): no coordinate system is named"


def _georeference(site: Site, geoid: Geoid) -> Georeference:
    latitude, longitude, height = site.datum
    return Georeference(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        epsg=site.epsg,
        convergence_deg=site.convergence_deg,
        scale=site.scale,
        heights=geoid.words,
        undulation_m=geoid.undulation_m if geoid.known else None,
    )
