"""Pictures of trees, in the size they are shown at."""

from __future__ import annotations

from pathlib import Path

import cv2

_QUALITY = 80


def smaller(path: Path, longest_px: int) -> bytes:
    """A JPEG whose longer edge is at most that. ValueError when the file holds no picture."""
    picture = cv2.imread(str(path))
    if picture is None:
        raise ValueError(f"{path}: not a picture that can be read; make the products again")
    share = min(1.0, longest_px / max(picture.shape[:2]))
    if share < 1.0:
        picture = cv2.resize(picture, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1])
