import cv2
import numpy as np

from edge.inventory.april_tags import look
from edge.process.camera_way import CameraWay
from edge.replay.video import Frame
from pipeline.camera import CameraModel
from pipeline.grounding.views import CameraRig
from pipeline.products.track import ESTIMATE, Placement

FORWARD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
LATE_S = 0.1


def test_a_tag_in_the_video_is_a_ray_from_where_the_camera_was_on_the_map_when_it_was_exposed():
    track = np.zeros(20, ESTIMATE)
    track["stamp_ns"] = np.arange(20) * 10**8
    track["position_m"][:, 0] = np.arange(20) * 0.1
    track["rotation"] = np.eye(3)
    yaw, shift = 0.5, np.array([7.0, -3.0, 50.0])
    placement = Placement.upright((40.0, -75.0, 0.0), np.tile(shift, (20, 1)), np.full(20, yaw), np.zeros((20, 6, 6)))
    lens = CameraModel(640, 480, (500.0, 500.0), (319.5, 239.5))
    way = CameraWay(track, placement, CameraRig(lens, FORWARD, np.array([0.0, 0.0, 0.2]), late_s=LATE_S))
    image = np.full((480, 640), 255, np.uint8)
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    image[180:300, 380:500] = cv2.aruco.generateImageMarker(family, 42, 120)
    told = []
    frames = [Frame(850_000_000, np.dstack([image] * 3)), Frame(10**12, np.dstack([image] * 3))]
    (seen,) = look(frames, way, told.append)
    assert told == [850_000_000, 10**12]
    assert seen.number == 42
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    np.testing.assert_allclose(seen.eye_m, turn @ [0.75, 0.0, 0.2] + shift, atol=1e-6)
    ray = np.array([(439.5 - 319.5) / 500, 1.0, 0.0])
    np.testing.assert_allclose(seen.ray, turn @ ray / np.linalg.norm(ray), atol=1e-3)
