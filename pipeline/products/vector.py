"""Layers for QGIS, QField and ArcGIS in a GeoPackage: the way and its poses, and what was found beside it."""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyogrio.raw
import shapely

from pipeline.products.areas import on_the_grid
from pipeline.products.earth import Site
from pipeline.products.handout import Handout
from pipeline.products.occurrences import UNVERIFIED, Columns, Survey, text
from pipeline.products.simplify import simplified
from pipeline.products.styles import layer_style

Array = npt.NDArray[np.float64]
_LINE_M = 0.1
"""The line leaves the way by at most this."""
_VERSION = "1.2"
"""Of the GeoPackage standard: newer ones make GDAL of two years ago, and what is built on it, warn."""
LOCAL_CRS = (
    'ENGCRS["local: metres from the start of the session, heading arbitrary",EDATUM["start of the session"],'
    'CS[Cartesian,2],AXIS["x",east],AXIS["y",north],LENGTHUNIT["metre",1]]'
)
"""Of a session that nobody could place on the Earth."""
_NAMESPACE = uuid.UUID("3c0f1d86-2a2b-4d0e-8a41-52b7ce0a9f6d")


@dataclass(frozen=True, slots=True)
class Layer:
    """kind: of its shapes, None for a table without any."""

    name: str
    kind: str | None = None
    crs: str | None = None
    about: str = ""


def write_way(path: Path, survey: Survey, columns: Columns, told: Mapping[str, Any]) -> None:
    """Begin a GeoPackage with `track`, one line that says what is `told`, and `poses`, points with time and `columns`.

    In the site's UTM zone, or local. columns: (n,) each.
    """
    path.unlink(missing_ok=True)
    way = survey.positions_m
    points = way if survey.site is None else survey.site.utm(way)
    length_m = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    line = shapely.linestrings(points[simplified(points, _LINE_M)])
    facts = {name: text([value]) if isinstance(value, str) else np.array([value]) for name, value in told.items()}
    named = {"run_id": text([survey.session]), "event_start": text([survey.start]), "event_end": text([survey.end])}
    system = metric(survey.site)
    write_layer(
        path, Layer("track", "LineString Z", system), [line], {**named, "length_m": np.array([length_m]), **facts}
    )
    times = survey.stamps_ns.astype("datetime64[ns]").astype("datetime64[ms]")
    write_layer(path, Layer("poses", "Point Z", system), shapely.points(points), {"time": times, **columns})


def add_findings(path: Path, handout: Handout) -> None:
    """Add `detections` with every column of the table, `patches`, and `searched_area`.

    Detections are in EPSG:4326, as databases want them, everything else as the way is.
    """
    site, positions = handout.survey.site, handout.findings.positions_m
    places = positions if site is None else site.geodetic(positions)
    detections = Layer("detections", "Point", LOCAL_CRS if site is None else "EPSG:4326", UNVERIFIED)
    write_layer(path, detections, shapely.points(places[:, :2]), handout.rows)
    shapes = [_placed(patch.outline, site) for patch in handout.patches]
    write_layer(path, Layer("patches", "Polygon", metric(site), UNVERIFIED), shapes, _patch_columns(handout))
    searched = [_placed(handout.searched, site)]
    write_layer(path, Layer("searched_area", "MultiPolygon", metric(site)), searched, _searched_columns(handout))


def add_styles(path: Path) -> None:
    """Last: how QGIS draws the layers, in the table that it looks for when it opens one."""
    layers = [name for name, _ in pyogrio.list_layers(path).tolist()]
    columns = {
        "f_table_catalog": text([""] * len(layers)),
        "f_table_schema": text([""] * len(layers)),
        "f_table_name": text(layers),
        "f_geometry_column": text(["geom"] * len(layers)),
        "styleName": text(layers),
        "styleQML": text([layer_style(layer) for layer in layers]),
        "styleSLD": text([""] * len(layers)),
        "useAsDefault": np.ones(len(layers), bool),
        "description": text(["mapforest"] * len(layers)),
        "owner": text([""] * len(layers)),
        "update_time": np.full(len(layers), np.datetime64("now", "ms")),  # QGIS orders by it
    }
    write_layer(path, Layer("layer_styles"), None, columns)


def _patch_columns(handout: Handout) -> Columns:
    grown, rows, survey = handout.patches, handout.rows, handout.survey
    members = [rows["source_id"][list(patch.members)].tolist() for patch in grown]
    return {
        "uuid": text([str(uuid.uuid5(_NAMESPACE, " ".join(names))) for names in members]),
        "infested_area_m2": np.array([patch.infested_m2 for patch in grown], np.float64).round(1),
        "gross_area_m2": np.array([patch.gross_m2 for patch in grown], np.float64).round(1),
        "percent_cover": np.array([patch.percent_cover for patch in grown], np.float64).round(1),
        "n_trees": np.array([len(patch.members) for patch in grown], np.int32),
        "trees": text([", ".join(str(rows["tree_id"][k]) for k in patch.members) for patch in grown]),
        "event_date": text([survey.start] * len(grown)),
        "observer": text([survey.observer] * len(grown)),
        "verification_status": text(["unverified"] * len(grown)),
    }


def _searched_columns(handout: Handout) -> Columns:
    findings, survey = handout.findings, handout.survey
    return {
        "uuid": text([str(uuid.uuid5(_NAMESPACE, f"{survey.session}/searched"))]),
        "area_m2": np.array([handout.searched.area]).round(1),
        "n_detections": np.array([len(findings.trees)], np.int32),
        "n_images": np.array([findings.images], np.int32),
        "survey_method": text([f"camera on the move, detector {findings.model.name}; unhidden map points within view"]),
        "event_start": text([survey.start]),
        "event_end": text([survey.end]),
        "observer": text([survey.observer]),
    }


def _placed(shape: Any, site: Site | None) -> Any:
    return shape if site is None else on_the_grid(shape, site)


def metric(site: Site | None) -> str:
    """The reference system of what is handed out in metres."""
    return LOCAL_CRS if site is None else f"EPSG:{site.epsg}"


def write_layer(path: Path, layer: Layer, shapes: Any, columns: Columns) -> None:
    """Into a GeoPackage, which is begun where it is not there."""
    pyogrio.raw.write(
        path,
        None if shapes is None else np.asarray(shapely.to_wkb(np.asarray(shapes, object)), object),
        list(columns.values()),
        list(columns),
        layer=layer.name,
        driver="GPKG",
        geometry_type=layer.kind,
        crs=layer.crs,
        append=path.exists(),
        dataset_options={} if path.exists() else {"VERSION": _VERSION},
        layer_options={"DESCRIPTION": layer.about},
    )
