"""What an image file is: size as it is shown, sharpness, hashes."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from edge.errors import FormatError
from pipeline.dataset.hashes import perceptual_hash
from pipeline.dataset.sharpness import sharpness

ENDINGS = (".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tif", ".tiff")


@dataclass(frozen=True, slots=True)
class ImageFacts:
    """Size in pixels as shown, turned by EXIF where it says so: labels are drawn on that."""

    sha256: str
    width_px: int
    height_px: int
    sharpness: float
    phash: str


def image_facts(data: bytes, where: str) -> ImageFacts:
    """Of the bytes of a file. FormatError when no image can be decoded from them."""
    try:
        grey = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE) if data else None
    except cv2.error as error:
        raise FormatError(f"{where}: not an image that can be read ({str(error).strip()})") from error
    if grey is None:
        raise FormatError(f"{where}: not an image that can be read ({len(data):,} bytes)")
    octets = np.asarray(grey, np.uint8)
    height, width = octets.shape
    return ImageFacts(digest(data), width, height, round(sharpness(octets), 3), perceptual_hash(octets))


def digest(data: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def image_files(folder: Path) -> list[Path]:
    """In a folder and those below it, in order of name."""
    return sorted(p for p in folder.rglob("*") if p.suffix.lower() in ENDINGS and p.is_file() and p.name[0] != ".")
