"""Images out of a session's video, with the stamps of their messages."""

from __future__ import annotations

import msgspec
import pytest
from mcap.writer import Writer

from drivers.messages import VideoFrame
from edge.config import Topics
from edge.errors import FormatError
from edge.replay.frames import VideoFrames, every, video_topic
from edge.replay.store import MessageStore
from edge.ros import schemas
from edge.ros.encode import encode_video
from tests.edge.live_recordings import record
from tests.edge.recording.recording_scene import UTC_NS
from tests.edge.recordings import QOS, START_NS
from tests.edge.replay import videos

TOPICS = Topics()


def stamp(index: int) -> int:
    return 1_000_000_007 + index * videos.PERIOD_NS


def messages(units):
    return [
        VideoFrame(stamp(index), 2_000_000_000 + place * videos.PERIOD_NS, unit, False, 0)
        for place, (index, unit) in enumerate(units)
    ]


def session(folder, units) -> MessageStore:
    return MessageStore([record(folder, messages(units))])


def seen(frames: VideoFrames, choose) -> list[int]:
    found = list(frames.read(choose))
    assert [frame.stamp_ns for frame in found] == [UTC_NS + stamp(videos.index_of(f.image_bgr)) for f in found]
    return [videos.index_of(frame.image_bgr) for frame in found]


@pytest.mark.parametrize("options", [None, videos.REORDERED])
def test_stamps_are_those_of_the_messages_to_the_nanosecond(tmp_path, options):
    frames = VideoFrames(session(tmp_path, videos.units(45, options)), TOPICS.video)
    assert seen(frames, every(0.0)) == list(range(45))
    assert frames.told == ()


def test_every_half_second_is_every_half_second(tmp_path):
    frames = VideoFrames(session(tmp_path, videos.units(95)), TOPICS.video)
    assert seen(frames, every(0.5)) == [0, 15, 30, 45, 60, 75, 90]
    assert frames.tally.decoded < 60
    assert seen(frames, lambda ns: ns in {UTC_NS + stamp(3), UTC_NS + stamp(77)}) == [3, 77]


def test_after_a_pause_the_period_begins_anew(tmp_path):
    choose = every(0.5)
    asked = [k * 100_000_000 for k in (0, 4, 5, 9, 57, 61, 62, 63)]
    assert [at // 100_000_000 for at in asked if choose(at)] == [0, 5, 57, 62]


def test_frames_that_cannot_be_decoded_use_up_no_turn(tmp_path):
    units = [unit for unit in videos.units(45) if unit[0] >= 4 and unit[0] != 23]
    frames = VideoFrames(session(tmp_path, units), TOPICS.video)
    assert seen(frames, every(0.4)) == [10, 22, 34]
    assert any("holes" in word for word in frames.told)


def foreign(path, payloads, topic="/cam"):
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "test")
        kind = schemas.COMPRESSED_VIDEO
        schema = writer.register_schema(kind, "ros2msg", schemas.schema_text(kind))
        channel = writer.register_channel(topic, "cdr", schema, {"offered_qos_profiles": QOS})
        for place, payload in enumerate(payloads):
            writer.add_message(channel, START_NS + place, payload, START_NS + place)
        writer.finish()
    return MessageStore([path])


def test_the_video_of_others_is_found_by_its_type_and_broken_messages_are_counted(tmp_path):
    good = [encode_video(message, message.stamp_ns) for message in messages(videos.units(12))]
    store = foreign(tmp_path / "other.mcap", [*good[:5], b"\x00\x01\x00\x00junk", *good[5:]])
    assert video_topic(store.topics, TOPICS) == "/cam"
    frames = VideoFrames(store, "/cam")
    assert len(list(frames.read(every(0.0)))) == 12
    assert frames.told == ("1 messages of /cam cannot be read",)


def test_a_recording_without_a_camera_says_so(tmp_path):
    assert video_topic({}, msgspec.structs.replace(TOPICS, video="/other")) == ""


def test_another_codec_is_named(tmp_path):
    payload = encode_video(messages(videos.units(1))[0], 5).replace(b"h264\x00", b"h265\x00")
    with pytest.raises(FormatError, match="/cam: its video is 'h265'"):
        list(VideoFrames(foreign(tmp_path / "other.mcap", [payload]), "/cam").read(every(0.0)))
