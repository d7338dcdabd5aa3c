import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from drivers.messages import ImuSample, LidarScan, VideoFrame
from edge.calibration.file import write
from edge.calibration.frames import extrinsics_of, with_camera
from edge.calibration.units import Units
from edge.cli.main import main
from edge.recording.calibration import CalibrationFile, Intrinsics, Timing, load_calibration
from pipeline.calibration.extrinsics import Found
from pipeline.camera import CameraModel
from tests.edge.live_recordings import record
from tests.edge.replay.videos import encoded
from tests.pipeline.calibration.boards import photograph
from tests.pipeline.calibration.rooms import BOARD, TRUE, guess, points

SECOND = 1_000_000_000
LATE_NS = 150_000_000
CAMERA = CameraModel(848, 480, (432.0, 432.0), (423.5, 239.5))
POSES = [(25, 0, 0), (-25, 5, 10), (0, 30, -5), (5, -30, 0), (20, 20, 15), (-20, -25, -10), (30, -10, 5)]


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    rng = np.random.default_rng(1)
    pictures, messages = [], []
    for k, angles in enumerate(POSES):
        turn = Rotation.from_euler("xyz", angles, degrees=True)
        move = np.array([0.25 * (k % 3 - 1), -0.35, 1.5 + 0.1 * k]) - turn.apply([0.28, 0.16, 0.0])
        photo = np.repeat(photograph(BOARD, CAMERA, turn, move)[:, :, None], 3, axis=2)
        begin_ns = SECOND * (1 + 2 * k)
        for i in range(6):  # held for 1 s, then away for 1 s
            at_ns = begin_ns + i * SECOND // 5
            pictures.append((at_ns + LATE_NS, photo))
            if i < 5:
                seen = points(turn.as_matrix(), move, rng, 0.01).astype(np.float32)
                octets = np.zeros(len(seen), np.uint8)
                offsets = np.linspace(0, 99_000_000, len(seen)).astype(np.uint32)
                messages.append(LidarScan(at_ns, at_ns, seen, octets, octets, octets, offsets))
        pictures.append((begin_ns + 6 * SECOND // 5 + LATE_NS, np.full((480, 848, 3), 90, np.uint8)))
    end_ns = SECOND * (2 + 2 * len(POSES))
    messages += [ImuSample(t, t, (0.0, 0.0, 0.0), (0.0, 0.0, 9.81)) for t in range(SECOND, end_ns, SECOND // 20)]
    units = encoded([picture for _, picture in pictures])
    for (stamp_ns, _), (index, data) in zip(pictures, units, strict=True):
        messages.append(VideoFrame(stamp_ns, stamp_ns, data, keyframe=True, pts_90khz=index))
    return record(tmp_path_factory.mktemp("board"), sorted(messages, key=lambda m: m.receive_ns))


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "calibration.toml"
    start = CalibrationFile(intrinsics=Intrinsics(), timing=Timing(camera_late_s=LATE_NS / 1e9))
    write(path, with_camera(start, Found(guess(1), np.eye(6)), "board", 0.0, Units()))
    return path


def test_the_camera_is_found_from_the_poses_in_which_the_board_was_held_still(session, file, capsys):
    arguments = ["calibrate", "board", str(session), "--corners", "8x5", "--square", "0.08", "--file", str(file)]
    assert main([*arguments, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    found = load_calibration(str(file)).file
    error = extrinsics_of(found).step_from(TRUE)
    assert np.degrees(np.linalg.norm(error[:3])) < 0.3
    assert np.linalg.norm(error[3:]) < 0.015
    assert len(report["holds"]) == len(POSES)
    assert report["moved_deg"] == pytest.approx(3.0, abs=0.3)
    assert found.about.camera_pose_by == "board"
    assert found.about.camera_rotation_sigma_deg == pytest.approx(report["rotation_sigma_deg"], abs=1e-4)
    assert found.about.camera_pose_residual == pytest.approx(report["residual_m"], abs=1e-5)


def test_another_board_than_was_held_is_not_found(session, file, capsys):
    before = file.read_bytes()
    assert main(["calibrate", "board", str(session), "--corners", "9x6", "--square", "0.08", "--file", str(file)]) == 1
    assert "can be used in 0 of 0 poses" in capsys.readouterr().err
    assert file.read_bytes() == before


def test_the_pose_in_the_file_and_the_one_from_the_lidar_are_the_same():
    file = with_camera(CalibrationFile(), Found(TRUE, np.eye(6)), "scene", 0.5, Units("L", "C"))
    again = extrinsics_of(file)
    assert again.rotation == pytest.approx(TRUE.rotation, abs=1e-6)
    assert again.translation_m == pytest.approx(TRUE.translation_m, abs=2e-5)
    assert (file.about.lidar_serial, file.about.camera_serial) == ("L", "C")


def test_the_nominal_camera_looks_ahead():
    ahead = extrinsics_of(CalibrationFile()).apply(np.array([[10.0, 0.0, 0.0]]))[0]
    assert ahead == pytest.approx([-0.023, 0.044 * -1 - 0.07, 10.0 - 0.071], abs=0.06)
    assert ahead[2] > 9.9
