"""The detector: is its model there, does it load, on what does it run, and how long does an image take."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, distribution
from typing import TYPE_CHECKING

from edge.config import Config
from edge.errors import EdgeError
from edge.preflight.check import Check, Outcome
from edge.recording.calibration import load_calibration
from pipeline.detection.errors import DetectionError

if TYPE_CHECKING:  # heavy: OpenCV
    from pipeline.detection.detector import Detector

SUBJECT = "detector"
_PACKAGES = ("onnxruntime", "onnxruntime-gpu")


def check_detection(config: Config) -> list[Check]:
    """Loads the model and tries it; on a Jetson that builds what TensorRT needs, which takes minutes once."""
    if not config.detection.model:
        return [Check(SUBJECT, Outcome.GOOD, "no model is configured: nothing is looked for in the images")]
    from edge.detection import open_detector  # noqa: PLC0415

    try:
        detector = open_detector(config.detection, threads=1)
        lens = load_calibration(config.calibration).file.intrinsics
        image_s = detector.time_s((lens.height_px, lens.width_px))
    except (DetectionError, EdgeError) as error:
        return [Check(SUBJECT, Outcome.BAD, str(error), "set detection.model, or empty it to go without"), *_both()]
    return [_pace(detector, image_s, config), *_device(detector, config), *_purpose(detector), *_both()]


def _pace(detector: Detector, image_s: float, config: Config) -> Check:
    settings, info = config.detection, detector.info
    found = f"{info.name} (sha256 {info.sha256[:12]}) on {info.device}: {1e3 * image_s:.0f} ms an image"
    affordable_hz = settings.core_share / (image_s * max(settings.threads, 1))
    if info.device != "cpu" or affordable_hz >= settings.rate_hz:
        return Check(SUBJECT, Outcome.GOOD, found)
    found += f", {affordable_hz:.1f} a second live instead of {settings.rate_hz:g}"
    return Check(SUBJECT, Outcome.WARNING, found, "a smaller model, a GPU, or a greater detection.core_share")


def _device(detector: Detector, config: Config) -> Iterator[Check]:
    from pipeline.detection.runtime import PROVIDERS, runtime  # noqa: PLC0415

    able = PROVIDERS["cuda"] in runtime().get_available_providers()
    if able and config.detection.device == "auto" and detector.info.device == "cpu":
        found = "this onnxruntime is made for a GPU, and runs on the processor"
        yield Check(SUBJECT, Outcome.WARNING, found, "its own words are above: most often cuDNN is missing or too old")


def _purpose(detector: Detector) -> Iterator[Check]:
    if notice := detector.info.notice:
        yield Check(SUBJECT, Outcome.WARNING, notice, "put a model trained on real images into detection.model")


def _both() -> Iterator[Check]:
    if all(map(_installed, _PACKAGES)):
        found = " and ".join(_PACKAGES) + " are both installed: which one is used is a matter of luck"
        advice = "uninstall both, then install the one for this computer (docs/detection.md)"
        yield Check(SUBJECT, Outcome.WARNING, found, advice)


def _installed(package: str) -> bool:
    try:
        distribution(package)
    except PackageNotFoundError:
        return False
    return True
