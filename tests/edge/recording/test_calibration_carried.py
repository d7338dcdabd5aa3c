import msgspec

from edge.calibration.file import write
from edge.recording.account import SessionAbout
from edge.recording.anchor import Anchor
from edge.recording.calibration import About, CalibrationFile, Pose
from edge.recording.folder import read_session
from edge.recording.session import SessionRecorder, session_folder
from edge.replay.store import MessageStore
from edge.ros.decode import decode_transforms
from tests.edge.recording.recording_scene import UTC_NS, FakeClock, FaultyDisk, limits


def test_the_whole_calibration_goes_into_the_session_and_into_each_file(tmp_path):
    path = tmp_path / "calibration.toml"
    write(path, CalibrationFile(camera=Pose((0.5, 0.0, 0.0)), about=About(date="2026-11-26", lidar_serial="L1")))
    config = msgspec.structs.replace(limits(), calibration=str(path))
    anchor = Anchor(UTC_NS, 0)
    folder = session_folder(tmp_path, "walk", anchor)
    recorder = SessionRecorder(folder, SessionAbout(), config, anchor, clock=FakeClock(), disk=FaultyDisk())
    recorder.start()
    recorder.stop("operator")
    assert read_session(folder).calibration_toml == path.read_text()
    store = MessageStore([folder])
    assert store.recording.facts is not None
    assert store.recording.facts["calibration_toml"] == path.read_text()
    (raw,) = store.some("/tf_static", [0])
    frames = {one.child: one.translation_m for _, one in decode_transforms(raw.data)}
    assert frames["camera"] == (0.5, 0.0, 0.0)
