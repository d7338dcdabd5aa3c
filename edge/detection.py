"""The detector that the configuration names."""

from __future__ import annotations

import logging
from importlib.resources import files
from pathlib import Path

from edge.config import Detection
from edge.errors import ConfigError
from edge.paths import cache_folder
from pipeline.detection.detector import Detector, Settings

log = logging.getLogger(__name__)

DEMO = "demo"
DEMO_MODEL = Path(str(files("pipeline.detection"))) / "models" / "ailanthus-demo.onnx"
"""Comes along: good for showing the software only."""


def model_path(name: str) -> Path:
    """The file of `detection.model`. ConfigError for a demonstration model that is not installed."""
    if name != DEMO:
        return Path(name).expanduser()
    if not DEMO_MODEL.exists():
        raise ConfigError(f"detection.model: {DEMO!r}: this installation has no {DEMO_MODEL.name}; give a file")
    return DEMO_MODEL


def open_detector(config: Detection, *, threads: int = 0, confidence: float | None = None) -> Detector:
    """Loaded and tried out; says it when the model is for demonstration only. DetectionError, ConfigError.

    threads: where the configuration leaves it open. confidence: other than configured.
    """
    settings = Settings(
        confidence=config.confidence if confidence is None else confidence,
        iou=config.iou,
        device=config.device,
        threads=config.threads or threads,
        cache=Path(config.cache).expanduser() if config.cache else cache_folder() / "tensorrt",
    )
    detector = Detector(model_path(config.model), settings)
    info = detector.info
    log.info("detector %s (sha256 %s) runs on %s", info.name, info.sha256[:12], info.device)
    if info.notice:
        log.warning("%s", info.notice)
    return detector
