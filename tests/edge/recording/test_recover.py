"""Repair: every complete chunk survives any cut and any damage, and what was lost is said."""

import random
from collections import Counter

import pytest
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType

from edge.errors import FormatError, RecordingError
from edge.recording.recover import finish_in_place, recover
from edge.recording.scan import RecordFile
from edge.recording.survey import ChunkPiece, survey
from tests.edge.recordings import (
    CODECS,
    START_NS,
    read_messages,
    recording_bytes,
    rosbags_counts,
    streamed_messages,
    write_recording,
)


def cuts(data: bytes, count: int) -> list[int]:
    noise = random.Random(len(data))
    return sorted(noise.randrange(200, len(data)) for _ in range(count))


def chunks_of(path):
    with RecordFile(path) as file:
        return [piece for piece in survey(file) if isinstance(piece, ChunkPiece)]


@pytest.mark.parametrize("codec", CODECS)
def test_every_complete_chunk_survives_any_cut(tmp_path, codec):
    data = recording_bytes(codec)
    for cut in cuts(data, 40):
        torn, copy = tmp_path / "torn.mcap", tmp_path / f"{cut}.mcap"
        torn.write_bytes(data[:cut])
        report = recover(torn, copy)
        expected = streamed_messages(data[:cut])
        assert read_messages(copy) == expected
        assert report.messages == len(expected)
        assert {t: n for t, n in report.topics.items() if n} == Counter(topic for topic, _, _ in expected)
        assert torn.read_bytes() == data[:cut]
        if expected:
            assert rosbags_counts(copy) == Counter(topic for topic, _, _ in expected)


@pytest.mark.parametrize("codec", CODECS)
def test_finishing_in_place_keeps_every_complete_chunk(tmp_path, codec):
    data = recording_bytes(codec)
    for cut in cuts(data, 40):
        torn = tmp_path / f"{cut}.mcap.active"
        torn.write_bytes(data[:cut])
        report = finish_in_place(torn)
        expected = streamed_messages(data[:cut])
        assert read_messages(torn) == expected
        assert report.messages == len(expected)
        closed = torn.read_bytes()
        assert finish_in_place(torn).complete
        assert torn.read_bytes() == closed


def test_every_cut_around_a_chunk_boundary_is_finished(tmp_path):
    data = recording_bytes(seconds=0.3)
    (tmp_path / "whole.mcap").write_bytes(data)
    piece = chunks_of(tmp_path / "whole.mcap")[1]
    for cut in range(piece.record.end - 3, piece.end + 12):
        torn = tmp_path / "torn.mcap"
        torn.write_bytes(data[:cut])
        finish_in_place(torn)
        assert read_messages(torn) == streamed_messages(data[:cut])


@pytest.mark.parametrize("codec", CODECS)
def test_recovering_a_whole_file_changes_nothing(tmp_path, codec):
    whole = write_recording(tmp_path / "whole.mcap", codec)
    report = recover(whole, tmp_path / "copy.mcap")
    assert report.lossless
    assert report.complete
    assert report.bytes_dropped == 0
    assert "Nothing was lost" in report.words()[0]
    assert read_messages(tmp_path / "copy.mcap") == read_messages(whole)
    again = recover(tmp_path / "copy.mcap", tmp_path / "again.mcap")
    assert again.lossless
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "copy.mcap").read_bytes()


def test_metadata_and_attachments_are_kept_and_indexed(tmp_path):
    whole = write_recording(tmp_path / "whole.mcap")
    recover(whole, tmp_path / "copy.mcap")
    with (tmp_path / "copy.mcap").open("rb") as stream:
        assert [record.name for record in make_reader(stream).iter_metadata()] == ["session", "mapforest"]


@pytest.mark.parametrize("codec", CODECS)
def test_a_damaged_chunk_is_skipped_and_told(tmp_path, codec):
    whole = write_recording(tmp_path / "whole.mcap", codec)
    before = read_messages(whole)
    pieces = chunks_of(whole)
    damaged = pieces[len(pieces) // 2]
    data = bytearray(whole.read_bytes())
    data[damaged.record.end - 40] ^= 0x10
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(data)
    report = recover(broken, tmp_path / "copy.mcap")
    after = read_messages(tmp_path / "copy.mcap")
    lost = Counter(topic for topic, _, _ in before) - Counter(topic for topic, _, _ in after)
    assert report.lost_messages == dict(lost)
    assert report.damages[0].messages == dict(lost)
    assert not report.lossless
    assert set(after) < set(before)
    assert report.damages[0].offset == damaged.record.offset
    assert "damaged chunk" in " ".join(report.words())


@pytest.mark.parametrize("codec", CODECS)
def test_random_bit_flips_lose_only_what_is_told(tmp_path, codec):
    data = recording_bytes(codec)
    noise = random.Random(7)
    whole = streamed_messages(data)
    for number in range(60):
        bad = bytearray(data)
        position = noise.randrange(len(bad))
        bad[position] ^= 1 << noise.randrange(8)
        broken, copy = tmp_path / "broken.mcap", tmp_path / f"{number}.mcap"
        broken.write_bytes(bad)
        report = recover(broken, copy)
        kept = read_messages(copy)
        assert set(kept) <= set(whole), position
        # A chunk holds at most about 60 messages here; the first also names the topics, which the summary repeats.
        assert len(whole) - len(kept) <= 60, position
        assert len(kept) == len(whole) or not report.lossless, position
        assert sum(report.lost_messages.values()) == len(whole) - len(kept) or not report.complete, position


def test_a_hole_of_zeros_in_an_open_file_is_stepped_over_in_place(tmp_path):
    data = bytearray(recording_bytes(finish=False))
    path = tmp_path / "hole.mcap.active"
    path.write_bytes(data)
    pieces = chunks_of(path)
    hole = pieces[len(pieces) - 3]
    data[hole.record.offset : hole.record.offset + 2000] = bytes(2000)
    path.write_bytes(data)
    report = finish_in_place(path)
    kept = read_messages(path)
    whole = streamed_messages(recording_bytes(finish=False))
    assert set(kept) < set(whole)
    assert len(whole) - len(kept) == sum(report.lost_messages.values())
    assert len(report.damages) == 1


def test_zeros_at_the_end_are_cut_off(tmp_path):
    data = recording_bytes(finish=False)
    path = tmp_path / "zeros.mcap.active"
    path.write_bytes(data + bytes(100_000))
    report = finish_in_place(path)
    assert read_messages(path) == streamed_messages(data)
    assert report.bytes_dropped >= 100_000


def test_what_is_missing_at_the_end_is_told_from_the_torn_chunk(tmp_path):
    data = recording_bytes(seconds=1.0)
    (tmp_path / "whole.mcap").write_bytes(data)
    last = chunks_of(tmp_path / "whole.mcap")[-1]
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(data[: last.record.end - 10])
    report = recover(torn, tmp_path / "copy.mcap")
    end_ns = max(log_time for _, log_time, _ in streamed_messages(data))
    assert report.lost_tail_s == pytest.approx((end_ns - report.last_ns) / 1e9)
    assert "s are missing" in " ".join(report.words())
    assert report.first_ns == START_NS


def test_lost_first_chunk_is_read_with_the_names_of_the_summary(tmp_path):
    data = bytearray(recording_bytes())
    (tmp_path / "whole.mcap").write_bytes(data)
    first = chunks_of(tmp_path / "whole.mcap")[0]
    data[first.record.end - 5] ^= 0xFF
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(data)
    recover(broken, tmp_path / "copy.mcap")
    kept = Counter(topic for topic, _, _ in read_messages(tmp_path / "copy.mcap"))
    assert kept["/imu"] > 300
    assert kept["/late"] > 0


def test_messages_without_a_name_are_dropped_and_told(tmp_path):
    data = bytearray(recording_bytes(finish=False))
    path = tmp_path / "open.mcap.active"
    path.write_bytes(data)
    first = chunks_of(path)[0]
    data[first.record.end - 5] ^= 0xFF
    path.write_bytes(data)
    report = recover(path, tmp_path / "copy.mcap")
    kept = Counter(topic for topic, _, _ in read_messages(tmp_path / "copy.mcap"))
    assert set(kept) == {"/late"}
    assert any(topic.startswith("(unknown") for topic in report.lost_messages)
    before = path.read_bytes()
    with pytest.raises(RecordingError, match="mapforest recover"):
        finish_in_place(path)
    assert path.read_bytes() == before


def test_a_damaged_beginning_is_stepped_over(tmp_path):
    data = recording_bytes()
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(bytes(30) + data[30:])
    report = recover(broken, tmp_path / "copy.mcap")
    assert Counter(read_messages(tmp_path / "copy.mcap")) == Counter(streamed_messages(data))
    assert not report.lossless


def test_files_without_indexes_or_chunks_get_them(tmp_path):
    bare = write_recording(tmp_path / "bare.mcap", index_types=IndexType.NONE, use_summary_offsets=False)
    flat = write_recording(tmp_path / "flat.mcap", use_chunking=False, compression=CompressionType.NONE)
    for source in (bare, flat):
        copy = tmp_path / f"copy_{source.name}"
        assert recover(source, copy).lossless
        assert read_messages(copy) == streamed_messages(source.read_bytes())
        assert rosbags_counts(copy)["/imu"] == 400


def test_open_file_without_chunks_is_finished(tmp_path):
    data = recording_bytes(finish=False, use_chunking=False)
    path = tmp_path / "flat.mcap.active"
    path.write_bytes(data[:-7])
    finish_in_place(path)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary.statistics.message_count == len(streamed_messages(data[:-7]))


def test_clear_refusals(tmp_path):
    empty, text, missing = tmp_path / "empty.mcap", tmp_path / "text.mcap", tmp_path / "missing.mcap"
    empty.write_bytes(b"")
    text.write_text("hello world, this is not a recording\n" * 10)
    stub = tmp_path / "stub.mcap"
    stub.write_bytes(recording_bytes()[:14])
    for path, words in ((empty, "empty"), (text, "not an MCAP"), (missing, "no such file"), (stub, "cut off")):
        with pytest.raises(FormatError, match=words):
            recover(path, tmp_path / "copy.mcap")
        with pytest.raises((FormatError, RecordingError)):
            finish_in_place(path)
    with pytest.raises(FormatError, match="folder"):
        recover(tmp_path, tmp_path / "copy.mcap")
    assert not (tmp_path / "copy.mcap").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["empty.mcap", "stub.mcap", "text.mcap"]


def test_the_input_is_never_written_over(tmp_path):
    whole = write_recording(tmp_path / "whole.mcap", seconds=0.2)
    link = tmp_path / "link.mcap"
    link.hardlink_to(whole)
    before = whole.read_bytes()
    for target, words in ((whole, "itself"), (link, "itself"), (write_recording(tmp_path / "other.mcap"), "exists")):
        with pytest.raises(RecordingError, match=words):
            recover(whole, target)
    assert whole.read_bytes() == before
    with pytest.raises(RecordingError, match="cannot be written"):
        recover(whole, tmp_path / "no such folder" / "copy.mcap")


def test_a_file_only_begun_is_finished_as_an_empty_recording(tmp_path):
    path = tmp_path / "begun.mcap.active"
    path.write_bytes(recording_bytes(seconds=0.0, finish=False))
    report = finish_in_place(path)
    assert report.messages == 0
    assert read_messages(path) == []


def test_an_unfinished_file_is_not_readable_before(tmp_path):
    path = tmp_path / "torn.mcap"
    path.write_bytes(recording_bytes()[:5000])
    with pytest.raises((McapError, ValueError)), path.open("rb") as stream:
        make_reader(stream).get_summary()


def test_damage_too_small_for_a_record_is_left_to_the_copy(tmp_path):
    data = recording_bytes(finish=False)
    path = tmp_path / "open.mcap.active"
    path.write_bytes(data)
    middle = chunks_of(path)[3].end
    path.write_bytes(data[:middle] + b"\x00\x00" + data[middle:])
    with pytest.raises(RecordingError, match="mapforest recover"):
        finish_in_place(path)
    recover(path, tmp_path / "copy.mcap")
    assert read_messages(tmp_path / "copy.mcap") == streamed_messages(data)
