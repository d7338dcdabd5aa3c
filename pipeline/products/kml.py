"""KML for phones and for Google Earth (OGC KML 2.2), and KMZ, which carries its pictures with it.

Everything is clamped to the ground: heights in KML are above EGM96, which nobody here knows exactly.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring
from xml.sax.saxutils import escape

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.polygon import orient

from pipeline.products.areas import on_the_globe
from pipeline.products.chips import smaller
from pipeline.products.earth import Site
from pipeline.products.handout import Handout
from pipeline.products.occurrences import UNVERIFIED, Survey
from pipeline.products.raster import Overlay
from pipeline.products.simplify import simplified
from pipeline.products.tables import table

Array = npt.NDArray[np.float64]
_LINE_M = 0.1
"""The line leaves the way by at most this."""
_CHIP_PX = 480
_STYLES: dict[str, dict[str, dict[str, str]]] = {
    "tree": {"IconStyle": {"color": "ff288cf2", "scale": "1.1"}},
    "way": {"LineStyle": {"color": "ffc5622b", "width": "3"}},
    "patch": {"LineStyle": {"color": "ff145ac2", "width": "2"}, "PolyStyle": {"color": "46288cf2"}},
    "searched": {"LineStyle": {"color": "ff808542", "width": "1"}, "PolyStyle": {"color": "1e808542"}},
}
"""Colours are alpha, blue, green, red."""


def write_kml(path: Path, survey: Survey) -> None:
    """The way alone."""
    document = _document(survey.session)
    document.append(_way(survey))
    path.write_bytes(_bytes(document))


def write_findings_kml(path: Path, handout: Handout) -> None:
    """Trees, patches, searched area and way, without pictures."""
    path.write_bytes(_bytes(_findings(handout, pictures=False)))


def write_kmz(path: Path, handout: Handout, overlay: Overlay | None) -> None:
    """The same with pictures: one a tree, and the evidence laid over the ground."""
    document = _findings(handout, pictures=True)
    if overlay is not None:
        document.append(_overlay(overlay))
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("doc.kml", _bytes(document), zipfile.ZIP_DEFLATED)
        if overlay is not None:
            packed.writestr("evidence.png", overlay.png)
        for tree, name in zip(handout.findings.trees, handout.rows["crop"], strict=True):
            if name:
                packed.writestr(name, smaller(handout.findings.chips[tree.tree_id], _CHIP_PX))


def _findings(handout: Handout, *, pictures: bool) -> Element:
    survey, site = handout.survey, _site(handout.survey)
    document = _document(survey.session, UNVERIFIED)
    found = _folder(document, f"Detections ({len(handout.findings.trees)})")
    found.extend(_tree(row, pictures=pictures) for row in table(handout.rows))
    grown = _folder(document, "Patches")
    for patch in handout.patches:
        told = f"{patch.infested_m2:.0f} m² below the crowns, {patch.gross_m2:.0f} m² in all"
        label = f"{len(patch.members)} trees" if len(patch.members) > 1 else "1 tree"
        grown.append(_area(label, told, "patch", on_the_globe(patch.outline, site)))
    if not handout.searched.is_empty:
        told = f"What the camera saw from {survey.start} to {survey.end}. Outside, nobody looked."
        document.append(_area("Searched area", told, "searched", on_the_globe(handout.searched, site)))
    document.append(_way(survey))
    return document


def _site(survey: Survey) -> Site:
    if survey.site is None:
        raise ValueError("a session without a place on the Earth has no KML; write local files")
    return survey.site


def _document(name: str, about: str = "") -> Element:
    document = Element("Document")
    SubElement(document, "name").text = name
    if about:
        SubElement(document, "description").text = about
    for style, parts in _STYLES.items():
        element = SubElement(document, "Style", id=style)
        for part, values in parts.items():
            into = SubElement(element, part)
            for key, value in values.items():
                SubElement(into, key).text = value
    return document


def _folder(document: Element, name: str) -> Element:
    folder = SubElement(document, "Folder")
    SubElement(folder, "name").text = name
    return folder


def _tree(row: Mapping[str, Any], *, pictures: bool) -> Element:
    mark = _placemark(f"Tree {row['tree_id']} ({row['probability']:.0%})", _words(row, pictures=pictures))
    SubElement(SubElement(mark, "TimeStamp"), "when").text = row["event_date"]
    SubElement(mark, "styleUrl").text = "#tree"
    data = SubElement(mark, "ExtendedData")
    for name, value in row.items():
        if value is not None:
            SubElement(SubElement(data, "Data", name=name), "value").text = str(value)
    point = SubElement(mark, "Point")
    SubElement(point, "coordinates").text = f"{row['longitude']:.8f},{row['latitude']:.8f}"
    return mark


def _words(row: Mapping[str, Any], *, pictures: bool) -> str:
    """HTML of the balloon."""
    lines = [
        f"{row['scientific_name'] or row['common_name']}, {row['verification_status']}",
        f"{row['probability']:.0%} from {row['n_hits']} of {row['n_views']} images",
        f"within {row['coordinate_uncertainty_m']:.1f} m (95 %), {row['from_track_m']:.0f} m from the way",
    ]
    lines += [f"{row['height_m']:.0f} m high"] if row["height_m"] is not None else []
    lines += [row["comments"]] if row["comments"] else []
    picture = f'<img src="{row["crop"]}" width="320"/><br/>' if pictures and row["crop"] else ""
    return picture + "<br/>".join(map(escape, lines))


def _area(name: str, about: str, style: str, shape: Any) -> Element:
    mark = _placemark(name, about)
    SubElement(mark, "styleUrl").text = f"#{style}"
    into = SubElement(mark, "MultiGeometry")
    for part in shapely.get_parts(shape):
        polygon, turned = SubElement(into, "Polygon"), orient(part)
        for kind, ring in _rings(turned):
            boundary = SubElement(SubElement(polygon, kind), "LinearRing")
            SubElement(boundary, "coordinates").text = _coordinates(np.array(ring.coords))
    return mark


def _rings(polygon: shapely.Polygon) -> Iterator[tuple[str, Any]]:
    yield "outerBoundaryIs", polygon.exterior
    for ring in polygon.interiors:
        yield "innerBoundaryIs", ring


def _way(survey: Survey) -> Element:
    mark = _placemark(survey.session)
    span = SubElement(mark, "TimeSpan")
    SubElement(span, "begin").text, SubElement(span, "end").text = survey.start, survey.end
    SubElement(mark, "styleUrl").text = "#way"
    line = SubElement(mark, "LineString")
    SubElement(line, "tessellate").text = "1"
    kept = survey.positions_m[simplified(survey.positions_m, _LINE_M)]
    SubElement(line, "coordinates").text = _coordinates(_site(survey).geodetic(kept))
    return mark


def _overlay(overlay: Overlay) -> Element:
    element = Element("GroundOverlay")
    SubElement(element, "name").text = "Evidence"
    SubElement(SubElement(element, "Icon"), "href").text = "evidence.png"
    box = SubElement(element, "LatLonBox")
    for side in ("north", "south", "east", "west"):
        SubElement(box, side).text = f"{getattr(overlay, side):.9f}"
    return element


def _placemark(name: str, about: str = "") -> Element:
    mark = Element("Placemark")
    SubElement(mark, "name").text = name
    if about:
        SubElement(mark, "description").text = about
    return mark


def _coordinates(places: Array) -> str:
    return " ".join(f"{longitude:.8f},{latitude:.8f}" for longitude, latitude in places[:, :2].tolist())


def _bytes(document: Element) -> bytes:
    root = Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    root.append(document)
    indent(root)
    return bytes(tostring(root, encoding="utf-8", xml_declaration=True))
