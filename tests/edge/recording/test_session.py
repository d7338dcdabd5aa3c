"""A session from start to stop: folder, splits, records, and readers that are not ours."""

from collections import Counter

import msgspec
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from edge.errors import RecordingError
from edge.recording.account import SessionAbout, Verdict
from edge.recording.folder import read_session, safe_name
from edge.recording.session import SessionRecorder, session_folder, set_verdict
from edge.recording.summary import SplitSummary
from tests.edge.recording.recording_scene import MS, UTC_NS, FakeClock, FaultyDisk, S, limits, second

SECONDS = 5


def record(root, seconds=SECONDS, about=None, config=None, **kwargs):
    """A session recorded as fast as it goes; returns recorder, result and what was offered."""
    clock = FakeClock()
    config = config or limits(split_s=2.0)
    folder = session_folder(root, "forest walk", clock.anchor())
    recorder = SessionRecorder(
        folder, about or SessionAbout(software="0.1"), config, clock.anchor(), clock=clock, **kwargs
    )
    recorder.start()
    offered = [message for k in range(seconds) for message in second(k * S)]
    for message in offered:
        recorder.offer(message)
    return recorder, recorder.stop("operator"), offered


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return record(tmp_path_factory.mktemp("recordings"), disk=FaultyDisk())


def messages(folder):
    """Every message of all splits: (split, topic, sequence, log, publish, data)."""
    found = []
    for number, path in enumerate(sorted(folder.glob("*.mcap"))):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
                found.append((number, channel.topic, message.sequence, message.log_time, message.publish_time))
    return found


def test_nothing_is_lost_or_doubled_across_splits(session):
    _, result, offered = session
    found = messages(result.folder)
    assert result.splits == tuple(f"{result.session}_{k}.mcap" for k in range(3))
    assert sum(topic != "/tf_static" for _, topic, *_ in found) == len(offered)
    for topic in {topic for _, topic, *_ in found}:
        sequences = [sequence for _, name, sequence, *_ in found if name == topic]
        assert sequences == list(range(len(sequences))), topic


def test_log_time_is_reception_and_publish_time_measurement(session):
    _, result, offered = session
    written = sorted((log, publish) for _, topic, _, log, publish in messages(result.folder) if topic != "/tf_static")
    assert written == sorted((UTC_NS + one.receive_ns, UTC_NS + one.stamp_ns) for one in offered)


def test_splits_follow_the_clock_and_each_has_the_static_transforms(session):
    _, result, _ = session
    found = messages(result.folder)
    for number in range(3):
        logs = [log for split, topic, _, log, _ in found if split == number and topic != "/tf_static"]
        assert max(logs) - min(logs) < 2 * S + 100 * MS
        assert sum(split == number and topic == "/tf_static" for split, topic, *_ in found) == 1


def test_rosbags_reads_the_folder_and_each_file_with_equal_counts(session):
    _, result, _ = session
    with AnyReader([result.folder]) as bag:
        counts = Counter(connection.topic for connection, _, _ in bag.messages())
        for connection, _, raw in bag.messages():
            bag.deserialize(raw, connection.msgtype)
        assert bag.message_count == result.messages
    assert counts == Counter(result.counts)
    alone: Counter = Counter()
    for name in result.splits:
        with AnyReader([result.folder / name]) as bag:
            alone.update(connection.topic for connection, _, _ in bag.messages())
    assert alone == counts


def test_quality_of_service_is_equal_in_channel_and_metadata(session):
    _, result, _ = session
    with Reader(result.folder) as bag:
        in_yaml = {one.topic: one.ext.offered_qos_profiles for one in bag.connections}
    for name in result.splits:
        with Reader(result.folder / name) as bag:
            in_file = {one.topic: one.ext.offered_qos_profiles for one in bag.connections}
        assert in_file == in_yaml
    assert in_yaml["/tf_static"][0].durability.name == "TRANSIENT_LOCAL"
    assert in_yaml["/livox/imu"][0].durability.name == "VOLATILE"


def test_messages_of_a_topic_come_back_in_order(session):
    _, result, _ = session
    last: dict[str, int] = {}
    with AnyReader([result.folder]) as bag:
        for connection, log_ns, _ in bag.messages():
            assert log_ns >= last.get(connection.topic, 0)
            last[connection.topic] = log_ns


def test_files_have_the_layout_readers_ask_for(session):
    _, result, _ = session
    with (result.folder / result.splits[0]).open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        decoded = [message for *_, message in reader.iter_decoded_messages(topics=["/livox/lidar"])]
    assert {one.encoding for one in summary.schemas.values()} == {"ros2msg"}
    assert {one.message_encoding for one in summary.channels.values()} == {"cdr"}
    assert all(one.metadata["offered_qos_profiles"].startswith("- history: 1\n") for one in summary.channels.values())
    assert all(one.uncompressed_size <= 1 << 20 for one in summary.chunk_indexes)
    assert all(one.message_index_offsets for one in summary.chunk_indexes)
    assert summary.statistics.message_count == sum(summary.statistics.channel_message_counts.values())
    assert len(decoded) == 20
    assert decoded[0].point_step == 26


def test_each_split_says_what_it_is_and_how_it_ended(session):
    _, result, _ = session
    endings = []
    for number, name in enumerate(result.splits):
        with (result.folder / name).open("rb") as stream:
            records = {one.name: one.metadata for one in make_reader(stream).iter_metadata()}
        assert records["session"]["split"] == str(number)
        assert records["session"]["anchor_utc_ns"] == str(UTC_NS)
        assert "[recording]" in records["session"]["config_toml"]
        summary = msgspec.json.decode(records["mapforest"]["summary"], type=SplitSummary)
        assert summary.topics["/tf_static"].count == 1
        endings.append(summary.ended)
    assert endings == ["split", "split", "operator"]
    assert summary.session_counts == result.counts
    assert summary.gnss_quality == {"4": 50}
    assert summary.diagnostics["livox"].values == {"points.lost": "3"}
    assert [mark.text for mark in summary.marks] == ["tree"] * 5
    assert summary.dropped == {}


def test_session_json_tells_the_story_and_takes_the_verdict(session):
    _, result, _ = session
    set_verdict(result.folder, Verdict("WARN", ("no fix for 12 s",)))
    record = read_session(result.folder)
    assert (record.state, record.reason, record.error) == ("finished", "operator", "")
    assert record.counts == result.counts
    assert record.started_utc == "2026-09-21T14:13:20.000Z"
    assert record.verdict == Verdict("WARN", ("no fix for 12 s",))
    assert sum(split.size_bytes for split in record.splits) == result.bytes_written


def test_nothing_else_is_left_in_the_folder(session):
    _, result, _ = session
    assert {path.name for path in result.folder.iterdir()} == {"metadata.yaml", "session.json", *result.splits}
    assert all((result.folder / name).stat().st_size for name in result.splits)


def test_stop_is_idempotent_and_what_comes_after_is_ignored(session):
    recorder, result, offered = session
    recorder.offer(offered[0])
    assert recorder.stop("again") is result
    assert recorder.status().dropped == {}


def test_folder_names_are_safe_and_unique(tmp_path):
    anchor = FakeClock().anchor()
    first = session_folder(tmp_path, "../Wald am Süd/hang", anchor)
    assert first == tmp_path / "20260921T141320Z_Wald-am-S-d-hang"
    first.mkdir()
    assert session_folder(tmp_path, "../Wald am Süd/hang", anchor).name.endswith("hang-2")
    assert safe_name("///") == "mission"


def test_a_second_session_in_the_same_folder_is_refused(session):
    _, result, _ = session
    clock = FakeClock()
    again = SessionRecorder(result.folder, SessionAbout(), limits(), clock.anchor(), disk=FaultyDisk())
    with pytest.raises(RecordingError, match="exists already"):
        again.start()


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_compressed_recordings_read_the_same(tmp_path, compression):
    _, result, _ = record(tmp_path, 1, config=limits(compression=compression), disk=FaultyDisk())
    with AnyReader([result.folder]) as bag:
        assert Counter(connection.topic for connection, _, _ in bag.messages()) == Counter(result.counts)
