"""The lens, from pictures of a board."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import msgspec
import numpy as np

from edge.calibration.file import today, with_units
from edge.calibration.pictures import NamedPicture
from edge.calibration.units import Units
from edge.errors import EdgeError, FormatError
from edge.recording.calibration import CalibrationFile, Intrinsics
from pipeline.calibration.board import Board, Image, Sighting, find
from pipeline.calibration.choice import Choice
from pipeline.calibration.lens import GRID, LensFit, View, board_pose, fit_lens
from pipeline.camera import LensModel

_RESIDUAL_SCALE = 50.0
"""Residuals are drawn so many times too long."""


class LensReport(msgspec.Struct, frozen=True):
    """seen: pictures looked at. alike, shaken: left out of those with the board. focal_apart: -1: cannot be told."""

    intrinsics: Intrinsics
    seen: int
    shaken: int
    alike: int
    used: int
    left_out: tuple[str, ...]
    covered: float
    coverage: tuple[tuple[int, ...], ...]
    focal_apart: float
    views: tuple[View, ...]
    concerns: tuple[str, ...]


class LensSearch:
    """Looks for the board in pictures of one size."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._choice: Choice | None = None
        self._stills: list[Sighting] = []
        self._size_px = (0, 0)
        self.seen = 0

    def look(self, pictures: Iterable[NamedPicture]) -> None:
        """FormatError for pictures of different sizes."""
        for picture in pictures:
            height, width = picture.image_bgr.shape[:2]
            if self._choice is None:
                self._size_px, self._choice = (width, height), Choice(width)
            if (width, height) != self._size_px:
                first = "x".join(map(str, self._size_px))
                raise FormatError(f"{picture.name}: {width}x{height} pixels, the first picture had {first}")
            self.seen += 1
            grey = np.asarray(cv2.cvtColor(picture.image_bgr, cv2.COLOR_BGR2GRAY), np.uint8)
            found = find(self._board, picture.name, grey)
            if picture.moving:
                self._choice.add(found)
            elif found is not None:
                self._stills.append(found)

    @property
    def sightings(self) -> list[Sighting]:
        """The ones to calibrate from."""
        return [*self._stills, *(self._choice.sightings() if self._choice is not None else ())]

    def fit(self, model: LensModel) -> tuple[LensFit, LensReport]:
        """CalibrationError when the pictures do not suffice."""
        found = fit_lens(self.sightings, self._size_px, model)
        camera = found.camera
        (fx, fy), (cx, cy) = camera.focal_px, camera.centre_px
        intrinsics = Intrinsics(
            *self._size_px,
            (round(fx, 3), round(fy, 3)),
            (round(cx, 3), round(cy, 3)),
            model,
            tuple(round(value, 7) for value in camera.distortion),
            round(found.rms_px, 4),
            today(),
        )
        report = LensReport(
            intrinsics=intrinsics,
            seen=self.seen,
            shaken=self._choice.shaken if self._choice is not None else 0,
            alike=self._choice.alike if self._choice is not None else 0,
            used=sum(view.used for view in found.views),
            left_out=tuple(view.name for view in found.views if not view.used),
            covered=found.covered,
            coverage=tuple(map(tuple, found.coverage.tolist())),
            focal_apart=-1.0 if found.focal_apart is None else found.focal_apart,
            views=found.views,
            concerns=found.concerns,
        )
        return found, report

    def map(self, found: LensFit) -> Image:
        """Where corners were seen, with what is left over of each, in a picture of the size of the others."""
        width, height = self._size_px
        canvas = np.full((height, width, 3), 255, np.uint8)
        for (row, column), count in np.ndenumerate(found.coverage):
            if not count:
                corner = (column * width // GRID[0], row * height // GRID[1])
                opposite = ((column + 1) * width // GRID[0], (row + 1) * height // GRID[1])
                cv2.rectangle(canvas, corner, opposite, (225, 225, 255), -1)
        by_name = {view.name: view for view in found.views}
        for one in self.sightings:
            if by_name[one.name].used:
                _draw(canvas, one, found)
        return canvas


def _draw(canvas: Image, one: Sighting, found: LensFit) -> None:
    pose = board_pose(one, found.camera)
    if pose is None:
        return
    rotation = np.asarray(cv2.Rodrigues(pose[0])[0], np.float64)
    left = found.camera.project(one.board_m @ rotation.T + pose[1])[0] - one.pixels
    for (u, v), (du, dv) in zip(one.pixels, left, strict=True):
        end = (round(u + _RESIDUAL_SCALE * du), round(v + _RESIDUAL_SCALE * dv))
        cv2.line(canvas, (round(u), round(v)), end, (60, 60, 220), 1, cv2.LINE_AA)
        cv2.circle(canvas, (round(u), round(v)), 2, (140, 70, 20), -1, cv2.LINE_AA)


def completed(file: CalibrationFile, report: LensReport, lens: str, units: Units) -> CalibrationFile:
    """The file with what was found. lens: the camera's mode, in words."""
    about = {"camera_lens": lens} if lens else {}
    return with_units(msgspec.structs.replace(file, intrinsics=report.intrinsics), units, **about)


def save_picture(path: Path, image: Image) -> None:
    """EdgeError when it cannot be written."""
    try:
        done = cv2.imwrite(str(path), image)
    except cv2.error as error:
        raise EdgeError(f"{path}: cannot be written: give a name that ends in .png or .jpg") from error
    if not done:
        raise EdgeError(f"{path}: cannot be written: is the folder there, and yours?")
