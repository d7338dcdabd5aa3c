"""Boxes in images: `rosbags`, taught the published definitions, reads what we write and writes what we read."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from edge.errors import FormatError
from edge.recording.messages import DetectedBox, Detections
from edge.ros import schemas
from edge.ros.decode_detections import Hypothesis, decode_detections
from edge.ros.encode import encode_detections

PUBLISHED = {
    "Point2D": "float64 x\nfloat64 y",
    "Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "ObjectHypothesis": "string class_id\nfloat64 score",
    "ObjectHypothesisWithPose": "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "Detection2D": "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox2D bbox\nstring id",
    "Detection2DArray": "std_msgs/Header header\nDetection2D[] detections",
}
STORE = get_typestore(Stores.ROS2_HUMBLE)
for name, definition in PUBLISHED.items():
    STORE.register(get_types_from_msg(definition, f"vision_msgs/msg/{name}"))
T = STORE.types
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
SIDES = st.floats(0, 4096)
BOXES = st.builds(
    DetectedBox, st.tuples(SIDES, SIDES, SIDES, SIDES), st.floats(0, 1), st.text("Ailanthus é", max_size=12)
)


@given(STAMPS, st.lists(BOXES, max_size=4))
def test_rosbags_reads_and_writes_the_same_bytes(stamp, boxes):
    data = encode_detections(Detections(1, 2, tuple(boxes)), stamp)
    read = STORE.deserialize_cdr(data, schemas.DETECTIONS)
    assert bytes(STORE.serialize_cdr(read, schemas.DETECTIONS)) == data
    assert (read.header.stamp.sec, read.header.stamp.nanosec, read.header.frame_id) == (*divmod(stamp, 10**9), "camera")
    for one, box in zip(read.detections, boxes, strict=True):
        left, top, right, bottom = box.box_px
        assert (one.bbox.center.position.x, one.bbox.center.position.y) == ((left + right) / 2, (top + bottom) / 2)
        assert (one.bbox.size_x, one.bbox.size_y) == (right - left, bottom - top)
        (hypothesis,) = [result.hypothesis for result in one.results]
        assert (hypothesis.class_id, hypothesis.score) == (box.class_name, box.confidence)


def test_the_definition_that_is_recorded_is_the_published_one():
    recorded = get_types_from_msg(schemas.schema_text(schemas.DETECTIONS).decode(), schemas.DETECTIONS)
    for name, fields in recorded.items():
        assert STORE.fielddefs[name] == fields


@given(STAMPS, st.lists(BOXES, max_size=4))
def test_what_was_encoded_comes_back(stamp, boxes):
    read = decode_detections(encode_detections(Detections(1, 2, tuple(boxes)), stamp))
    assert (read.stamp_ns, read.frame_id) == (stamp, "camera")
    for one, box in zip(read.detections, boxes, strict=True):
        assert one.box_px == pytest.approx(box.box_px, abs=1e-9)
        assert one.hypotheses == (Hypothesis(box.class_name, box.confidence),)


def test_several_hypotheses_and_a_turned_box_of_others_are_read():
    pose = T["geometry_msgs/msg/PoseWithCovariance"](
        pose=T["geometry_msgs/msg/Pose"](
            position=T["geometry_msgs/msg/Point"](x=1.0, y=2.0, z=3.0),
            orientation=T["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        ),
        covariance=np.zeros(36),
    )
    results = [
        T["vision_msgs/msg/ObjectHypothesisWithPose"](
            hypothesis=T["vision_msgs/msg/ObjectHypothesis"](class_id=name, score=score), pose=pose
        )
        for name, score in (("elm", 0.75), ("ash", 0.25))
    ]
    header = T["std_msgs/msg/Header"](stamp=T["builtin_interfaces/msg/Time"](sec=3, nanosec=4), frame_id="left")
    centre = T["vision_msgs/msg/Pose2D"](position=T["vision_msgs/msg/Point2D"](x=50.0, y=40.0), theta=0.5)
    box = T["vision_msgs/msg/BoundingBox2D"](center=centre, size_x=20.0, size_y=10.0)
    one = T["vision_msgs/msg/Detection2D"](header=header, results=results, bbox=box, id="7")
    message = T["vision_msgs/msg/Detection2DArray"](header=header, detections=[one, one])
    read = decode_detections(bytes(STORE.serialize_cdr(message, schemas.DETECTIONS, little_endian=False)))
    assert (read.stamp_ns, read.frame_id, len(read.detections)) == (3_000_000_004, "left", 2)
    (first, _) = read.detections
    assert (first.box_px, first.theta_rad, first.track) == ((40.0, 35.0, 60.0, 45.0), 0.5, "7")
    assert [(one.class_id, one.score) for one in first.hypotheses] == [("elm", 0.75), ("ash", 0.25)]


WHOLE = encode_detections(Detections(1, 2, (DetectedBox((1.0, 2.0, 3.0, 4.0), 0.5, "a"),)), 5)


@given(st.integers(0, len(WHOLE) - 1))
def test_cut_off_bytes_are_refused(size):
    with pytest.raises(FormatError):
        decode_detections(WHOLE[:size])
