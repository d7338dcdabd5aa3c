"""Findings as text: GeoJSON, and the columns that iMapInvasives and Darwin Core take."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from pipeline.products.occurrences import UNVERIFIED, Columns

Row = Mapping[str, Any]
_REMARK = "unverified detection of a machine"


def write_geojson(path: Path, rows: Columns, session: str) -> None:
    """Points with every column (RFC 7946: WGS 84, longitude first, heights above the ellipsoid)."""
    told = {
        "type": "FeatureCollection",
        "name": session,
        "description": UNVERIFIED,
        "features": list(map(_feature, table(rows))),
    }
    path.write_text(json.dumps(told, ensure_ascii=False, allow_nan=False, indent=1) + "\n", encoding="utf-8")


def write_imapinvasives(path: Path, rows: Columns) -> None:
    """For its bulk upload, of one jurisdiction. The observer has to be known there."""
    _write(path, rows, _IMAP)


def write_darwin_core(path: Path, rows: Columns) -> None:
    """Occurrences in simple Darwin Core."""
    _write(path, rows, _DARWIN_CORE)


def write_csv(path: Path, rows: Columns) -> None:
    """Every column under its own name."""
    _write(path, rows, {name: _column(name) for name in rows})


def table(rows: Columns) -> Iterator[dict[str, Any]]:
    """Row by row, as plain numbers and text; None where nothing is known."""
    for values in zip(*(column.tolist() for column in rows.values()), strict=True):
        yield {name: None if _unknown(value) else value for name, value in zip(rows, values, strict=True)}


def _unknown(value: Any) -> bool:
    return value == "" or (isinstance(value, float) and math.isnan(value))


def _feature(row: Row) -> dict[str, Any]:
    place = [row["longitude"], row["latitude"], row["ellipsoidal_height_m"]]
    return {
        "type": "Feature",
        "id": row["uuid"],
        "geometry": {"type": "Point", "coordinates": place},
        "properties": row,
    }


def _write(path: Path, rows: Columns, columns: Mapping[str, Callable[[Row], Any]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows([of(row) for of in columns.values()] for row in table(rows))


def _column(name: str) -> Callable[[Row], Any]:
    return lambda row: row[name]


def _remarks(row: Row) -> str:
    return "; ".join(filter(None, (_REMARK, row["comments"])))


def _dynamic(row: Row) -> str:
    kept = ("probability", "n_views", "n_hits", "stem_seen", "height_m", "crown_m", "model_sha256")
    return json.dumps({name: row[name] for name in kept})


_IMAP: dict[str, Callable[[Row], Any]] = {
    "Source Unique ID": _column("uuid"),
    "Date": lambda row: row["event_date"][:10],
    "Observer": _column("observer"),
    "Latitude": _column("latitude"),
    "Longitude": _column("longitude"),
    "Species": _column("scientific_name"),
    "Comments": _remarks,
}
_DARWIN_CORE: dict[str, Callable[[Row], Any]] = {
    "occurrenceID": lambda row: f"urn:uuid:{row['uuid']}",
    "basisOfRecord": _column("basis_of_record"),
    "scientificName": _column("scientific_name"),
    "vernacularName": _column("common_name"),
    "occurrenceStatus": _column("occurrence_status"),
    "organismQuantity": _column("organism_quantity"),
    "organismQuantityType": lambda _: "individuals",
    "eventID": _column("run_id"),
    "eventDate": lambda row: f"{row['event_date']}/{row['event_end']}",
    "decimalLatitude": _column("latitude"),
    "decimalLongitude": _column("longitude"),
    "geodeticDatum": lambda _: "EPSG:4326",
    "coordinateUncertaintyInMeters": _column("coordinate_uncertainty_m"),
    "minimumElevationInMeters": _column("elevation_m"),
    "maximumElevationInMeters": _column("elevation_m"),
    "georeferenceProtocol": _column("georef_protocol"),
    "recordedBy": _column("observer"),
    "institutionCode": _column("organization"),
    "identifiedBy": lambda row: f"detector {row['model']}",
    "identificationVerificationStatus": _column("verification_status"),
    "associatedMedia": _column("crop"),
    "occurrenceRemarks": _remarks,
    "dynamicProperties": _dynamic,
}
"""Header -> what stands below it."""
