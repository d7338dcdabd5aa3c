"""Products of what a detector found."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

from edge.errors import EdgeError
from edge.process.product_facts import FindingFacts, Shelf
from edge.process.way_files import Walk, pose_columns, way_facts
from pipeline.products.handout import Handout
from pipeline.products.kml import write_findings_kml, write_kmz
from pipeline.products.occurrences import DEMONSTRATION, UNVERIFIED, utc
from pipeline.products.raster import preview, write_geotiff
from pipeline.products.styles import detections_style, evidence_style
from pipeline.products.tables import write_csv, write_darwin_core, write_geojson, write_imapinvasives
from pipeline.products.vector import add_findings, add_styles, write_way

PICTURES = "DCIM"
PACKAGES = ("findings.gpkg", "findings_local.gpkg")
LAYERS = "detections, patches, searched area, track and poses"


def write_finding_files(shelf: Shelf, handout: Handout, walk: Walk) -> None:
    """On the Earth, or local files that say so. EdgeError when trees and poses are in different frames."""
    findings = handout.findings
    if findings.frame != walk.poses.frame:
        frames = f"the trees are in `{findings.frame}`, the poses in `{walk.poses.frame}`"
        raise EdgeError(f"{frames}: do the grounding again, with `mapforest process --fresh`")
    shelf.facts.findings = _facts(handout)
    _pictures(shelf, handout)
    if handout.survey.site is None:
        _local(shelf, handout, walk)
    else:
        _on_the_earth(shelf, handout, walk)


def keep_verified(folder: Path) -> list[str]:
    """Take a package in which people confirmed or rejected trees out of the way of a new one. Returns what was done.

    Of findings that did not change, `uuid` joins the old and the new.
    """
    told = []
    for path in (folder / name for name in PACKAGES):
        if path.exists() and (count := _verified(path)):
            kept = path.with_name(f"{path.stem}_verified_{utc(path.stat().st_mtime_ns).replace(':', '')}.gpkg")
            path.replace(kept)
            told.append(f"{count} trees in {path.name} had been verified: it was kept as {kept.name}")
    return told


def _verified(path: Path) -> int:
    try:
        with closing(sqlite3.connect(path)) as package:
            (count,) = package.execute(
                "select count(*) from detections where verification_status is not 'unverified'"
            ).fetchone()
            return int(count)
    except sqlite3.DatabaseError:  # not a package any more: nothing to keep
        return 0


def _local(shelf: Shelf, handout: Handout, walk: Walk) -> None:
    with shelf.put("findings_local.gpkg", f"{LAYERS}; local metres, no place on the Earth") as path:
        _geopackage(path, handout, walk)
    with shelf.put("findings_local.csv", "detections; local metres, no place on the Earth") as path:
        write_csv(path, handout.rows)


def _on_the_earth(shelf: Shelf, handout: Handout, walk: Walk) -> None:
    site = walk.survey.site
    assert site is not None
    with shelf.put("findings.gpkg", f"{LAYERS}, for QGIS, QField and ArcGIS") as path:
        _geopackage(path, handout, walk)
    with shelf.put("detections.geojson", "detections in WGS 84 (RFC 7946)") as path:
        write_geojson(path, handout.rows, handout.survey.session)
    with shelf.put("detections.qml", "how QGIS draws detections.geojson") as path:
        path.write_text(detections_style(), encoding="utf-8")
    with shelf.put("findings.kml", "detections, patches, searched area and track, for Google Earth") as path:
        write_findings_kml(path, handout)
    with shelf.put("findings.kmz", "the same with pictures and the evidence laid over the ground, for phones") as path:
        write_kmz(path, handout, preview(site, handout.findings.coverage))
    with shelf.put("findings_imapinvasives.csv", "detections for the bulk upload of iMapInvasives") as path:
        write_imapinvasives(path, handout.rows)
    with shelf.put("findings_darwin_core.csv", "detections as Darwin Core occurrences") as path:
        write_darwin_core(path, handout.rows)
    _raster(shelf, handout)


def _geopackage(path: Path, handout: Handout, walk: Walk) -> None:
    write_way(path, handout.survey, pose_columns(walk.poses), way_facts(walk))
    add_findings(path, handout)
    add_styles(path)


def _raster(shelf: Shelf, handout: Handout) -> None:
    survey, findings = handout.survey, handout.findings
    assert survey.site is not None
    if findings.coverage.bounds_m() is None:
        return
    tags = {
        "session": survey.session,
        "model": findings.model.name,
        "model_sha256": findings.model.sha256,
        "warning": f"{UNVERIFIED} {DEMONSTRATION if findings.model.demonstration else ''}".strip(),
        "nodata_means": "not searched; 0 in the first band means searched, and nothing speaks for the tree",
    }
    with shelf.put("evidence.tif", "evidence, times seen and uncertainty, a cloud-optimised GeoTIFF") as path:
        write_geotiff(path, survey.site, findings.coverage, tags)
    with shelf.put("evidence.qml", "how QGIS draws evidence.tif") as path:
        path.write_text(evidence_style(), encoding="utf-8")


def _pictures(shelf: Shelf, handout: Handout) -> None:
    named = [(tree, name) for tree, name in zip(handout.findings.trees, handout.rows["crop"], strict=True) if name]
    if not named:
        return
    (shelf.folder / PICTURES).mkdir(exist_ok=True)
    for tree, name in named:
        shutil.copyfile(handout.findings.chips[tree.tree_id], shelf.folder / name)
    shelf.facts.files[PICTURES] = "a picture of each tree, where QField looks for them"


def _facts(handout: Handout) -> FindingFacts:
    findings = handout.findings
    return FindingFacts(
        model=findings.model.name,
        model_sha256=findings.model.sha256,
        demonstration=findings.model.demonstration,
        images=findings.images,
        trees=len(findings.trees),
        patches=len(handout.patches),
        infested_m2=round(sum(patch.infested_m2 for patch in handout.patches), 1),
        searched_m2=round(handout.searched.area, 1),
        warning=UNVERIFIED,
    )
