"""The static transforms: nominal, from a file, and refused in words."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from edge.config import Topics
from edge.errors import ConfigError
from edge.recording.anchor import Anchor
from edge.recording.calibration import load_calibration
from edge.recording.disk import Disk, Space, floor_bytes
from edge.ros.topics import channels


def test_nominal_geometry_of_the_payload():
    frames = {one.child: one for one in load_calibration("").transforms}
    assert set(frames) == {"livox_frame", "camera", "gnss_antenna"}
    assert {one.parent for one in frames.values()} == {"base_link"}
    assert frames["livox_frame"].translation_m == (-0.011, -0.02329, 0.04412)
    optical = Rotation.from_quat(frames["camera"].rotation_xyzw).as_matrix()
    np.testing.assert_allclose(optical, [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], atol=1e-12)


def test_a_file_replaces_what_it_names(tmp_path):
    path = tmp_path / "calibration.toml"
    path.write_text("[camera]\ntranslation_m = [0.1, 0.2, 0.3]\nrotation_xyzw = [0.0, 0.0, 0.0, 1.0]\n")
    calibration = load_calibration(str(path))
    frames = {one.child: one for one in calibration.transforms}
    assert frames["camera"].translation_m == (0.1, 0.2, 0.3)
    assert frames["livox_frame"].translation_m[2] == 0.04412
    assert calibration.text == path.read_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[kamera]\n", "kamera"),
        ("[camera]\nrotation_xyzw = [0.0, 0.0, 0.0, 2.0]\n", "unit quaternion"),
        ("[camera]\ntranslation_m = [0.0]\n", "translation_m"),
        ("[camera", "not valid TOML"),
    ],
)
def test_a_wrong_file_is_refused_in_words(tmp_path, text, words):
    path = tmp_path / "calibration.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words):
        load_calibration(str(path))


def test_two_kinds_of_message_cannot_share_a_topic():
    with pytest.raises(ConfigError, match=r"topics\.imu: '/livox/lidar' is also topics\.lidar"):
        channels(Topics(imu="/livox/lidar"))


def test_an_anchor_turns_host_time_into_utc():
    anchor = Anchor.now()
    assert anchor.session_ns(anchor.monotonic_ns + 5) == anchor.utc_ns + 5
    assert abs(Anchor.now().offset_ns - anchor.offset_ns) < 1_000_000_000


def test_the_reserve_is_the_larger_of_share_and_size():
    space = Space(100 << 30, 0)
    assert floor_bytes(space, 2048, 3.0) == int(0.03 * (100 << 30))
    assert floor_bytes(space, 4096, 3.0) == 4096 << 20


def test_the_real_disk_replaces_a_file_whole(tmp_path):
    disk, path = Disk(), tmp_path / "session.json"
    for content in (b"old", b"new"):
        disk.replace(path, content)
        assert path.read_bytes() == content
    assert list(tmp_path.iterdir()) == [path]
    assert disk.space(tmp_path).total_bytes >= disk.space(tmp_path).free_bytes > 0
