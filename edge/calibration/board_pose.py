"""Where the camera sits, from a recording of a board that is held up in many poses."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from edge.calibration.board_holds import find_holds
from edge.calibration.frames import apart, extrinsics_of, with_camera
from edge.calibration.recording import CalibrationRecording
from edge.recording.calibration import CalibrationFile
from edge.replay.lens import camera_model
from pipeline.calibration.board import Board
from pipeline.calibration.board_extrinsics import BoardFound, HoldReport, from_board


class BoardReport(msgspec.Struct, frozen=True):
    """Sigmas: about the axis and in the direction that is known least. moved: from what the file said."""

    session: str
    rotation_sigma_deg: float
    translation_sigma_m: float
    residual_m: float
    moved_deg: float
    moved_m: float
    holds: tuple[HoldReport, ...]
    refusal: str


def measure(
    recording: CalibrationRecording, board: Board, file: CalibrationFile, advance: Callable[[float], None]
) -> tuple[BoardFound, BoardReport]:
    """The file's pose of the camera is the guess. CalibrationError when the board is hardly seen."""
    guess = extrinsics_of(file)
    holds = find_holds(recording, board, file, advance)
    found = from_board(holds, board, camera_model(file.intrinsics), guess)
    moved_deg, moved_m = apart(found.extrinsics, guess)
    report = BoardReport(
        session=recording.name,
        rotation_sigma_deg=found.rotation_sigma_deg,
        translation_sigma_m=found.translation_sigma_m,
        residual_m=found.residual_m,
        moved_deg=moved_deg,
        moved_m=moved_m,
        holds=found.holds,
        refusal=found.refusal,
    )
    return found, report


def completed(file: CalibrationFile, found: BoardFound, recording: CalibrationRecording) -> CalibrationFile:
    """The file with what was found."""
    return with_camera(file, found, "board", found.residual_m, recording.units())
