"""The images a detector did worst on, side by side in one picture: what it missed, and what it invented."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.detection.letterbox import fit
from pipeline.evaluation.detection import ImageErrors

Image = npt.NDArray[np.uint8]
Array = npt.NDArray[np.float64]
Colour = tuple[int, int, int]
MOST = 12
COLUMNS = 3
TILE_PX = (320, 560)
"""Height and width of the picture in a tile."""
_WORDS_PX = 26
_GAP_PX = 8
_RIGHT, _MISSED, _WRONG = (115, 158, 0), (0, 159, 230), (80, 60, 214)
"""BGR that most eyes tell apart (Okabe and Ito 2008, the last one redder); the words tell the rest."""
_PAPER, _INK = (250, 252, 251), (32, 38, 29)
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def write_contact_sheet(path: Path, worst: Sequence[ImageErrors], names: Sequence[str]) -> int:
    """How many images are on it. OSError where it cannot be written, ValueError for an ending OpenCV does not know."""
    shown = [one for one in worst if one.image.path is not None][:MOST]
    tiles = [_tile(one, names) for one in shown] or [_blank("no image with an error")]
    tiles += [np.full_like(tiles[0], _PAPER)] * (-len(tiles) % min(COLUMNS, len(tiles)))
    wide = min(COLUMNS, len(tiles))
    rows = [np.hstack(tiles[k : k + wide]) for k in range(0, len(tiles), wide)]
    try:
        written, octets = cv2.imencode(path.suffix or ".jpg", np.vstack(rows))
    except cv2.error as error:
        raise ValueError(f"{path}: pictures end in .jpg or .png") from error
    if not written:
        raise ValueError(f"{path}: cannot be encoded")
    path.write_bytes(octets.tobytes())
    return len(shown)


def _tile(one: ImageErrors, names: Sequence[str]) -> Image:
    pixels = cv2.imread(str(one.image.path), cv2.IMREAD_COLOR)
    if pixels is None:
        return _blank(f"{one.image.name}: cannot be read")
    where = fit((pixels.shape[0], pixels.shape[1]), TILE_PX)
    height, width = where.inner_px
    small = np.asarray(cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    _draw(small, one, names)
    wrong = int((~one.hits).sum())
    tile = _blank(f"{one.image.name}: {int(one.missed.sum())} missed, {wrong} wrong")
    tile[_WORDS_PX : _WORDS_PX + height, where.left_px : where.left_px + width] = small
    return tile


def _draw(picture: Image, one: ImageErrors, names: Sequence[str]) -> None:
    truth, found = one.image.truth, one.found
    for box, number, missed in zip(truth.boxes, truth.class_id, one.missed, strict=True):
        _rectangle(picture, box, _MISSED if missed else _RIGHT)
        if missed:
            _label(picture, box[[0, 3]], _MISSED, f"missed {names[number]}", below=True)
    for box, number, sure, hit in zip(found.boxes, found.class_id, found.confidence, one.hits, strict=True):
        if not hit:
            _rectangle(picture, box, _WRONG)
            _label(picture, box[:2], _WRONG, f"{names[number]} {sure:.2f}")


def _rectangle(picture: Image, box: Array, colour: Colour) -> None:
    left, top, right, bottom = (*_pixel(picture, box[:2]), *_pixel(picture, box[2:]))
    cv2.rectangle(picture, (left, top), (right, bottom), colour, 2, cv2.LINE_AA)


def _label(picture: Image, corner: Array, colour: Colour, words: str, *, below: bool = False) -> None:
    """Above or below a box, as far as the picture reaches."""
    (long, high), _ = cv2.getTextSize(words, _FONT, 0.45, 1)
    left, edge = _pixel(picture, corner)
    base = min(edge + high + 4, picture.shape[0] - 3) if below else max(edge - 4, high + 2)
    left = max(min(left, picture.shape[1] - long - 4), 0)
    cv2.rectangle(picture, (left, base - high - 3), (left + long + 4, base + 3), colour, cv2.FILLED)
    cv2.putText(picture, words, (left + 2, base), _FONT, 0.45, (255, 255, 255), 1, cv2.LINE_AA)


def _pixel(picture: Image, share: Array) -> tuple[int, int]:
    height, width, _ = picture.shape
    return round(float(share[0]) * (width - 1)), round(float(share[1]) * (height - 1))


def _blank(words: str) -> Image:
    height, width = TILE_PX
    tile = np.full((height + _WORDS_PX + _GAP_PX, width + _GAP_PX, 3), _PAPER, np.uint8)
    cv2.putText(tile, words, (4, _WORDS_PX - 8), _FONT, 0.5, _INK, 1, cv2.LINE_AA)
    return tile
