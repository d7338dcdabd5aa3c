"""The board that is held before the camera: a chessboard, or a ChArUco board, which may be seen in part.

Board frame: origin at the first inner corner, x along the columns, y along the rows, z away from who looks at it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pipeline.calibration.errors import CalibrationError

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]
LEAST_CORNERS = 8
SEARCHED_PX = 1280
"""Wide is enough to find a board in; its corners are then refined in the whole picture. At 1920 a search takes twice as
long (0.5 s), and ends no nearer; at 960 one board in twelve is missed."""
_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)


@dataclass(frozen=True, slots=True)
class Board:
    """columns, rows: inner corners. square_m: side of a square.

    A ChArUco board has markers of marker_m in its white squares, from OpenCV's dictionary of that name.
    """

    columns: int
    rows: int
    square_m: float
    kind: Literal["chessboard", "charuco"] = "chessboard"
    marker_m: float = 0.0
    dictionary: str = "5X5_100"

    def __post_init__(self) -> None:
        """CalibrationError for a board that cannot be."""
        if self.columns < 3 or self.rows < 3 or self.square_m <= 0:
            raise CalibrationError(
                f"a board of {self.columns}x{self.rows} inner corners of {self.square_m:g} m: at least 3x3 are needed, "
                "and squares of some size; inner corners are counted where four squares meet"
            )
        if self.kind == "charuco" and not 0 < self.marker_m < self.square_m:
            raise CalibrationError(f"markers of {self.marker_m:g} m do not fit squares of {self.square_m:g} m")
        if self.kind == "chessboard" and self.columns == self.rows:
            raise CalibrationError(f"a chessboard of {self.columns}x{self.rows} looks the same turned by 90 degrees")

    @property
    def corners_m(self) -> Array:
        """(columns * rows, 3) in the board frame, row by row."""
        rows, columns = np.mgrid[: self.rows, : self.columns]
        flat = np.column_stack([columns.ravel(), rows.ravel(), np.zeros(self.rows * self.columns)])
        return flat * self.square_m

    @property
    def outline_m(self) -> Array:
        """(4, 2): the edge of the outer squares."""
        s = self.square_m
        right, bottom = self.columns * s, self.rows * s
        return np.array([[-s, -s], [right, -s], [right, bottom], [-s, bottom]])


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """A board in a picture. board_m: (n, 3) in the board frame. pixels: (n, 2), (0, 0) the centre of the first."""

    name: str
    board_m: Array
    pixels: Array

    @property
    def by_corner(self) -> dict[tuple[float, float], Array]:
        """Pixel of each corner, by where it is on the board (metres)."""
        keys = np.round(self.board_m[:, :2], 6).tolist()
        return {(x, y): pixel for (x, y), pixel in zip(keys, self.pixels, strict=True)}


def find(board: Board, name: str, grey: Image) -> Sighting | None:
    """The board in a grey picture; None where it is not, or shows too few corners."""
    if board.kind == "charuco":
        return _find_charuco(board, name, grey)
    shrunk = min(1.0, SEARCHED_PX / grey.shape[1])
    small = cv2.resize(grey, None, fx=shrunk, fy=shrunk, interpolation=cv2.INTER_AREA) if shrunk < 1.0 else grey
    size = (board.columns, board.rows)
    there, found = cv2.findChessboardCornersSB(small, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not there:
        return None
    rough = (np.asarray(found, np.float32).reshape(-1, 1, 2) + 0.5) / shrunk - 0.5
    return Sighting(name, board.corners_m, _refined(grey, rough, 0.35))


def _refined(grey: Image, rough: npt.NDArray[np.float32], reach: float) -> Array:
    """Corners to a tenth of a pixel. reach: of the window, in squares; there must be nothing else in it."""
    near, _ = cKDTree(rough.reshape(-1, 2)).query(rough.reshape(-1, 2), [2])
    half = int(np.clip(reach * np.min(near), 2, 9))
    corners = cv2.cornerSubPix(grey, rough.astype(np.float32), (half, half), (-1, -1), _CRITERIA)
    return np.asarray(corners, np.float64).reshape(-1, 2)


def picture(board: Board, square_px: int) -> Image:
    """The board to print, with a white margin of a square."""
    if board.kind == "charuco":
        size = ((board.columns + 1) * square_px, (board.rows + 1) * square_px)
        inner = np.asarray(_charuco(board).generateImage(size), np.uint8)
    else:
        rows, columns = np.mgrid[: (board.rows + 1) * square_px, : (board.columns + 1) * square_px] // square_px
        inner = np.where((rows + columns) % 2, 255, 0).astype(np.uint8)
    return np.pad(inner, square_px, constant_values=255)


def _find_charuco(board: Board, name: str, grey: Image) -> Sighting | None:
    corners, ids, _, _ = cv2.aruco.CharucoDetector(_charuco(board)).detectBoard(grey)
    if ids is None or len(ids) < LEAST_CORNERS:
        return None
    rough = np.asarray(corners, np.float32).reshape(-1, 1, 2)
    # As OpenCV 4.11 gives them they are half a pixel off. Markers end short of the corners by this much.
    reach = 0.45 * (1.0 - board.marker_m / board.square_m)
    return Sighting(name, board.corners_m[np.asarray(ids).ravel()], _refined(grey, rough, reach))


def _charuco(board: Board) -> Any:
    number = getattr(cv2.aruco, f"DICT_{board.dictionary}", None)
    if number is None:
        raise CalibrationError(f"dictionary {board.dictionary!r}: OpenCV has none of that name; 5X5_100 is one")
    dictionary = cv2.aruco.getPredefinedDictionary(number)
    return cv2.aruco.CharucoBoard((board.columns + 1, board.rows + 1), board.square_m, board.marker_m, dictionary)
