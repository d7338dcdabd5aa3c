"""Runs in QGIS's Python. `qgis_render.py PRODUCTS PICTURE`: opens the layers as a person would, draws them, says what
it found as JSON.
"""

import json
import os
import sys
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
from qgis.core import (
    Qgis,
    QgsApplication,
    QgsMapRendererSequentialJob,
    QgsMapSettings,
    QgsRasterLayer,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QSize
from qgis.PyQt.QtGui import QColor

folder, picture = Path(sys.argv[1]), sys.argv[2]
application = QgsApplication([], False)
application.initQgis()
raster = QgsRasterLayer(str(folder / "evidence.tif"), "evidence")
found, layers = {}, [raster]
for name in ("searched_area", "patches", "track", "poses", "detections"):
    layer = QgsVectorLayer(f"{folder / 'findings.gpkg'}|layername={name}", name, "ogr")
    message, good = layer.loadDefaultStyle()
    found[name] = {
        "valid": layer.isValid(),
        "style": "from the package" if good and "Provider" in message else message,
        "renderer": layer.renderer().type(),
        "crs": layer.crs().authid(),
    }
    layers.insert(0, layer)
settings = QgsMapSettings()
settings.setLayers(layers)
settings.setDestinationCrs(raster.crs())
settings.setBackgroundColor(QColor(255, 255, 255))
settings.setOutputSize(QSize(1100, 1000))
view = raster.extent()
view.scale(1.1)
settings.setExtent(view)
job = QgsMapRendererSequentialJob(settings)
job.start()
job.waitForFinished()
job.renderedImage().save(picture)
told = {"valid": raster.isValid(), "renderer": raster.renderer().type()}
print(json.dumps({"version": Qgis.QGIS_VERSION.split("-")[0], "layers": found, "raster": told}))
