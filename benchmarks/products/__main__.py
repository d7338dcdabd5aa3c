"""`python -m benchmarks.products PRODUCTS [--picture FILE.png]`: other programs open what was handed out.

Of Debian: `apt-get install gdal-bin qgis python3-qgis`. `pip install fastkml lxml rio-cogeo laszip` brings the schema
of KML, a judge of cloud-optimised GeoTIFFs and the reference decoder of LAZ. What is not installed is passed over and
said. Exit code 1 when a program refuses a file, or reads something else.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path

PROBE = Path(__file__).parent / "probes" / "qgis_render.py"
SYSTEM_PYTHON = "/usr/bin/python3"
"""QGIS's own: its bindings are in no virtual environment."""
Check = Callable[[Path], Iterator[str]]
"""Yields what it saw; raises Refused when that is not what it should be."""


class Refused(Exception):
    """A program did not take the file, or took it for something else."""


def main() -> int:
    """Exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("products", type=Path)
    parser.add_argument("--picture", type=Path, default=Path("qgis.png"), help="what QGIS draws")
    args = parser.parse_args()
    checks: dict[str, Check] = {
        "gdalinfo evidence.tif": raster,
        "rio-cogeo evidence.tif": cogeo,
        "laszip map.laz": cloud,
        "ogrinfo findings.gpkg": geopackage,
        "ogrinfo detections.geojson": geojson,
        "XML schema of KML 2.2": kml,
        "QGIS": lambda folder: qgis(folder, args.picture.absolute()),
    }
    good = True
    for name, check in checks.items():
        try:
            for line in check(args.products):
                print(f"{name}: {line}")
        except (FileNotFoundError, ImportError) as error:
            print(f"{name}: passed over, {error}")
        except Refused as error:
            print(f"{name}: REFUSED {error}")
            good = False
    return 0 if good else 1


def raster(folder: Path) -> Iterator[str]:
    """Layout, bands, and what stands for nothing."""
    told = json.loads(ask("gdalinfo", "-json", "-stats", "--config", "GDAL_PAM_ENABLED", "NO", folder / "evidence.tif"))
    layout = told["metadata"]["IMAGE_STRUCTURE"].get("LAYOUT")
    same(layout, "COG")
    yield f"{layout}, {told['size']} pixels"
    for band, name in zip(told["bands"], ("evidence", "count", "uncertainty"), strict=True):
        same((band["description"], str(band["noDataValue"]).lower()), (name, "nan"))
        yield f"{name}, {band['unit']}: {band['minimum']:.3f} to {band['maximum']:.3f}, no-data NaN"


def cogeo(folder: Path) -> Iterator[str]:
    """Whether the layout is that of the standard."""
    from rio_cogeo.cogeo import cog_validate

    good, errors, warnings = cog_validate(folder / "evidence.tif")
    if not good or warnings:
        raise Refused("; ".join((*errors, *warnings)))
    yield "a valid cloud-optimised GeoTIFF"


def cloud(folder: Path) -> Iterator[str]:
    """The points by the LASzip of the format's author, beside those of the decoder that is used here."""
    import laspy
    import laszip  # noqa: F401 - only where it is installed

    ours, theirs = (
        laspy.read(folder / "map.laz", laz_backend=backend)
        for backend in (laspy.LazBackend.Lazrs, laspy.LazBackend.Laszip)
    )
    same(bool((ours.points.array == theirs.points.array).all()), expected=True)
    yield f"{len(theirs.points):,} points, {', '.join(theirs.point_format.extra_dimension_names)}"


def geopackage(folder: Path) -> Iterator[str]:
    """Layers and their counts, without a warning."""
    rows = len(json.loads((folder / "detections.geojson").read_text(encoding="utf-8"))["features"])
    for layer in ("detections", "patches", "searched_area", "track", "poses"):
        told = ask("ogrinfo", "-so", "-ro", folder / "findings.gpkg", layer)
        counted = next(line for line in told.splitlines() if line.startswith("Feature Count"))
        if layer == "detections":
            same(counted, f"Feature Count: {rows}")
        yield f"{layer}, {counted.lower()}"


def geojson(folder: Path) -> Iterator[str]:
    """As GDAL takes it."""
    told = ask("ogrinfo", "-so", "-ro", "-al", folder / "detections.geojson")
    yield next(line for line in told.splitlines() if line.startswith("Feature Count")).lower()


def kml(folder: Path) -> Iterator[str]:
    """Against the schema of the OGC."""
    from lxml import etree

    schema = etree.XMLSchema(etree.parse(str(files("fastkml") / "schema" / "ogckml22.xsd")))
    for name in ("trajectory.kml", "findings.kml", "findings.kmz"):
        path = folder / name
        text = zipfile.ZipFile(path).read("doc.kml") if name.endswith("kmz") else path.read_bytes()
        if not schema.validate(etree.fromstring(text)):
            raise Refused(f"{name}: {schema.error_log[0]}")
        yield f"{name} is valid"


def qgis(folder: Path, picture: Path) -> Iterator[str]:
    """Its own styles, and a map drawn with them."""
    told = json.loads(ask(SYSTEM_PYTHON, PROBE, folder, picture, quiet=False).splitlines()[-1])
    for layer, found in told["layers"].items():
        same((found["valid"], found["style"]), (True, "from the package"))
        yield f"{layer}: {found['renderer']}, {found['crs']}"
    same(told["raster"], {"valid": True, "renderer": "singlebandpseudocolor"})
    yield f"QGIS {told['version']} drew {picture}"


def ask(*command: object, quiet: bool = True) -> str:
    """What a program prints. Refused when it fails, or complains where it should be quiet."""
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    if done.returncode or (quiet and done.stderr.strip()):
        raise Refused(f"{command[0]} ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return done.stdout


def same(found: object, expected: object) -> None:
    """Refused when they differ."""
    if found != expected:
        raise Refused(f"found {found}, expected {expected}")


if __name__ == "__main__":
    sys.exit(main())
