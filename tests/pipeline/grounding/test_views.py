import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.grounding.views import CameraRig, Pose, camera_view
from tests.pipeline.grounding.grove import CAMERA

MS = 1_000_000
TURN = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
RIG = CameraRig(CAMERA, TURN, np.array([0.06, 0.0, -0.07]), late_s=0.03, time_sigma_s=0.01)


def pose(t_ms):
    """Turning at 30 degrees a second and going at 1.5 m/s."""
    turn = Rotation.from_euler("z", 0.03 * t_ms, degrees=True).as_matrix()
    return Pose(t_ms * MS, turn, np.array([1.5e-3 * t_ms, 0.0, 0.0]))


def test_the_camera_is_where_it_was_at_the_exposure():
    view = camera_view(80 * MS, pose(0), pose(100), RIG)
    body = pose(50)
    np.testing.assert_allclose(view.rotation, body.rotation @ TURN, atol=1e-12)
    np.testing.assert_allclose(view.position_m, body.position_m + body.rotation @ RIG.position_m, atol=1e-12)
    assert view.bearing_sigma_rad == pytest.approx(np.radians(30) * 0.01)
    assert view.position_sigma_m == pytest.approx(0.015)
    assert view.lasting_rad == RIG.rotation_sigma_rad


@pytest.mark.parametrize(("stamp_ms", "after_ms"), [(20, 100), (140, 100), (80, 600)])
def test_no_view_where_the_pose_is_not_known(stamp_ms, after_ms):
    assert camera_view(stamp_ms * MS, pose(0), pose(after_ms), RIG) is None
