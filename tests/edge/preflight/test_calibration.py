from edge.calibration.file import write
from edge.calibration.units import Units
from edge.config import Config
from edge.preflight.calibration import check_calibration, units_of
from edge.preflight.check import Outcome
from edge.recording.calibration import About, CalibrationFile, Intrinsics, Timing

WHOLE = CalibrationFile(
    intrinsics=Intrinsics(residual_px=0.2),
    timing=Timing(0.12, 0.001, 0.99),
    about=About(date="2026-11-26", lidar_serial="L1", camera_serial="C1", camera_pose_by="board"),
)


def configured(tmp_path, file: CalibrationFile) -> Config:
    path = tmp_path / "calibration.toml"
    write(path, file)
    return Config(calibration=str(path))


def test_a_whole_calibration_of_these_units_is_good(tmp_path):
    (check,) = check_calibration(configured(tmp_path, WHOLE), Units("L1", "C1"))
    assert check.outcome is Outcome.GOOD
    assert "120 ms late" in check.found


def test_a_calibration_of_other_units_is_told_by_their_serial_numbers(tmp_path):
    lidar, camera = check_calibration(configured(tmp_path, WHOLE), Units("L2", "C9"))
    assert lidar.outcome is camera.outcome is Outcome.WARNING
    assert "made with LiDAR L1, this one is L2" in lidar.found
    assert "made with camera C1, this one is C9" in camera.found
    assert lidar.advice


def test_units_that_are_not_known_are_no_others(tmp_path):
    (check,) = check_calibration(configured(tmp_path, WHOLE), Units())
    assert check.outcome is Outcome.GOOD


def test_what_is_still_nominal_is_named(tmp_path):
    file = CalibrationFile(intrinsics=Intrinsics(residual_px=0.2))
    (check,) = check_calibration(configured(tmp_path, file), Units())
    assert check.outcome is Outcome.WARNING
    assert "nominal is the camera's pose, how late the camera is" in check.found


def test_a_broken_file_is_bad(tmp_path):
    path = tmp_path / "calibration.toml"
    path.write_text("[camera]\nrotation_xyzw = [1.0, 1.0, 0.0, 0.0]\n")
    (check,) = check_calibration(Config(calibration=str(path)), Units())
    assert check.outcome is Outcome.BAD
    assert "unit quaternion" in check.found


def test_serial_numbers_come_from_the_drivers_whatever_the_sensors_are_called():
    config = Config(sensors={"front": {"driver": "livox"}, "eye": {"driver": "gopro"}, "reach": {"driver": "reach"}})
    details = {"front": {"serial number": "L7"}, "eye": {"serial": "C7"}, "reach": {"serial": "R7"}}
    assert units_of(config, details) == Units("L7", "C7")
