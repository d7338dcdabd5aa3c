import json

import numpy as np
import pytest

from drivers.messages import ImuSample, LidarScan, VideoFrame
from edge.calibration.file import write
from edge.cli.main import main
from edge.recording.calibration import CalibrationFile, Intrinsics, Pose, load_calibration
from edge.recording.messages import Diagnostics, DiagnosticStatus, Level
from pipeline.camera import CameraModel
from tests.edge.live_recordings import record
from tests.edge.replay.videos import encoded
from tests.pipeline.calibration.turns import MOUNTED, SECOND, Turns

CAMERA = CameraModel(320, 180, (160.0, 160.0), (159.5, 89.5))
LATE_S = 0.12


def sweep() -> LidarScan:
    octets = np.zeros(5, np.uint8)
    return LidarScan(SECOND, SECOND, np.ones((5, 3), np.float32), octets, octets, octets, np.arange(5, dtype=np.uint32))


def told(serial: str) -> Diagnostics:
    values = (("serial number", serial),)
    return Diagnostics(SECOND, SECOND, (DiagnosticStatus("sensor/livox", Level.OK, "ok", serial, values),))


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    turns = Turns(seed=21, seconds=14.0)
    gyro = turns.gyro()
    messages = [
        ImuSample(int(t), int(t), tuple(w.tolist()), (0.0, 0.0, 9.81))
        for t, w in zip(gyro.middle_ns, gyro.rate, strict=True)
    ]
    pictures = list(turns.pictures(CAMERA, late_s=LATE_S))
    units = encoded(np.repeat(picture.grey[:, :, None], 3, axis=2) for picture in pictures)
    messages += [
        VideoFrame(picture.stamp_ns, picture.stamp_ns, data, keyframe=index % 30 == 0, pts_90khz=index)
        for picture, (index, data) in zip(pictures, units, strict=True)
    ]
    messages += [sweep(), told("L-1")]
    return record(tmp_path_factory.mktemp("turning"), sorted(messages, key=lambda m: m.receive_ns))


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "calibration.toml"
    lens = Intrinsics(320, 180, (160.0, 160.0), (159.5, 89.5))
    write(path, CalibrationFile(camera=Pose((0.1, 0.0, 0.0), tuple(MOUNTED.as_quat().tolist())), intrinsics=lens))
    return path


def test_how_late_the_camera_is_goes_into_the_file_with_the_units_it_belongs_to(session, file, capsys):
    assert main(["calibrate", "time", str(session), "--file", str(file), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    found = load_calibration(str(file)).file
    assert found.timing.camera_late_s == pytest.approx(LATE_S, abs=2e-3)
    assert found.timing.sigma_s < 0.01
    assert found.timing.date == found.about.date != ""
    assert found.about.lidar_serial == "L-1"
    assert found.camera.translation_m == (0.1, 0.0, 0.0)
    assert report["mounted_off_deg"] < 1.0


def test_a_camera_that_turned_as_if_mounted_otherwise_is_a_warning(session, file, capsys):
    found = load_calibration(str(file)).file
    write(file, CalibrationFile(intrinsics=found.intrinsics))
    turned = Pose((0.1, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    write(file, CalibrationFile(camera=turned, intrinsics=found.intrinsics))
    assert main(["calibrate", "time", str(session), "--file", str(file), "--dry-run"]) == 3
    assert "measure it again" in capsys.readouterr().out
    assert load_calibration(str(file)).file.timing.correlation == 0.0


def test_what_cannot_be_told_leaves_the_file_as_it_was(session, file, capsys):
    before = file.read_bytes()
    assert main(["calibrate", "time", str(session), "--file", str(file), "--seconds", "5"]) == 1
    out = capsys.readouterr().out
    assert "cannot be told" in out
    assert "left as it was" in out
    assert file.read_bytes() == before


def test_a_recording_without_video_says_so(tmp_path, file, capsys):
    still = [ImuSample(k, k, (0.0, 0.0, 0.0), (0.0, 0.0, 9.81)) for k in range(SECOND, 2 * SECOND, 5_000_000)]
    folder = record(tmp_path, [sweep(), *still])
    assert main(["calibrate", "time", str(folder), "--file", str(file)]) == 1
    assert "no video in this recording" in capsys.readouterr().err
