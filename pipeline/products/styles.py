"""How QGIS (3.16 and later) draws the layers: QML, as little of it as it takes."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, tostring

STATUSES = {"unverified": "242,140,40,255", "confirmed": "194,37,37,255", "rejected": "130,130,130,255"}
"""What people make of a detection, and its colour."""
RAMP = ((0.0, (66, 133, 128, 90)), (0.35, (250, 214, 92, 150)), (0.7, (236, 120, 40, 215)), (1.0, (178, 24, 24, 255)))
"""Of evidence, 0..1: red, green, blue, alpha. The first is where one searched and nothing speaks for the tree."""
_PLAIN: dict[str, tuple[str, str, dict[str, str]]] = {
    "patches": ("fill", "SimpleFill", {"color": "242,140,40,70", "outline_color": "194,90,20,255"}),
    "searched_area": ("fill", "SimpleFill", {"color": "66,133,128,30", "outline_color": "66,133,128,255"}),
    "track": ("line", "SimpleLine", {"line_color": "43,98,197,255", "line_width": "0.6"}),
    "poses": ("marker", "SimpleMarker", {"color": "43,98,197,255", "outline_style": "no", "size": "0.7"}),
}
"""Layer -> kind of symbol, its class, what differs from QGIS's defaults."""


def layer_style(layer: str) -> str:
    """Of a layer of findings.gpkg."""
    if layer == "detections":
        return detections_style()
    root = _root("Symbology")
    renderer = SubElement(root, "renderer-v2", type="singleSymbol")
    _symbol(SubElement(renderer, "symbols"), 0, *_PLAIN[layer])
    return _text(root)


def detections_style() -> str:
    """Dots coloured by verification and labelled with the tree's number; the form shows the picture."""
    root = _root("Symbology|Labeling|Fields|Forms", labelsEnabled="1")
    renderer = SubElement(root, "renderer-v2", type="categorizedSymbol", attr="verification_status")
    categories, symbols = SubElement(renderer, "categories"), SubElement(renderer, "symbols")
    for number, (status, colour) in enumerate(STATUSES.items()):
        SubElement(categories, "category", value=status, label=status, symbol=str(number), render="true")
        dot = {"color": colour, "outline_color": "255,255,255,255", "outline_width": "0.4", "size": "3.6"}
        _symbol(symbols, number, "marker", "SimpleMarker", {"name": "circle", **dot})
    _label(root, "tree_id")
    fields = SubElement(root, "fieldConfiguration")
    choices = SubElement(_widget(fields, "verification_status", "ValueMap"), "Option", name="map", type="List")
    for status in STATUSES:
        SubElement(SubElement(choices, "Option", type="Map"), "Option", name=status, type="QString", value=status)
    picture = _widget(fields, "crop", "ExternalResource")
    for name in ("DocumentViewer", "RelativeStorage"):  # shown as a picture; the path begins at the project's folder
        SubElement(picture, "Option", name=name, type="int", value="1")
    return _text(root)


def evidence_style() -> str:
    """Of evidence.tif: its first band."""
    root = _root("Symbology")
    told = {"type": "singlebandpseudocolor", "band": "1", "opacity": "1", "alphaBand": "-1"}
    bounds = {"classificationMin": "0", "classificationMax": "1"}
    renderer = SubElement(SubElement(root, "pipe"), "rasterrenderer", {**told, **bounds})
    shader = SubElement(SubElement(renderer, "rastershader"), "colorrampshader", colorRampType="INTERPOLATED")
    for value, (red, green, blue, alpha) in RAMP:
        colour = f"#{red:02x}{green:02x}{blue:02x}"
        SubElement(shader, "item", value=f"{value:g}", label=f"{value:g}", color=colour, alpha=str(alpha))
    return _text(root)


def _root(categories: str, **attributes: str) -> Element:
    return Element("qgis", {"version": "3.16", "styleCategories": categories, **attributes})


def _symbol(symbols: Element, number: int, kind: str, drawer: str, options: dict[str, str]) -> None:
    symbol = SubElement(symbols, "symbol", type=kind, name=str(number), alpha="1")
    layer = SubElement(symbol, "layer", {"class": drawer, "enabled": "1"})
    told = SubElement(layer, "Option", type="Map")
    for name, value in options.items():
        SubElement(told, "Option", name=name, type="QString", value=value)
        SubElement(layer, "prop", k=name, v=value)  # before QGIS 3.20


def _label(root: Element, field: str) -> None:
    settings = SubElement(SubElement(root, "labeling", type="simple"), "settings")
    style = SubElement(
        settings, "text-style", fieldName=field, fontSize="9", fontSizeUnit="Point", textColor="40,40,40,255"
    )
    SubElement(
        style, "text-buffer", bufferDraw="1", bufferSize="0.8", bufferSizeUnits="MM", bufferColor="255,255,255,255"
    )
    SubElement(settings, "placement", placement="6", dist="0.5", distUnits="MM")


def _widget(fields: Element, name: str, kind: str) -> Element:
    """Where the options of a field's editor go."""
    editor = SubElement(SubElement(fields, "field", name=name), "editWidget", type=kind)
    return SubElement(SubElement(editor, "config"), "Option", type="Map")


def _text(root: Element) -> str:
    indent(root)
    return f"<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n{tostring(root, encoding='unicode')}\n"
