"""A recorder that was cut off: what was flushed is there, and the next start puts it in order."""

import io
import random
import shutil
from collections import Counter

import pytest
from mcap.exceptions import McapError
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader

from edge.recording.account import SessionAbout
from edge.recording.folder import read_session
from edge.recording.recover import finish_in_place
from edge.recording.session import SessionRecorder, repair_leftovers, session_folder
from tests.edge.recording.recording_scene import FakeClock, FaultyDisk, S, limits, second
from tests.waiting import wait_for


class CutOff:
    """A recording of 3.5 s in splits of 2 s, copied as it was on the disk at that moment, with sizes at each flush."""

    def __init__(self, root):
        self.flushed: list[tuple[int, int]] = []
        clock, disk = FakeClock(), FaultyDisk()
        folder = session_folder(root / "live", "cut", clock.anchor())
        config = limits(split_s=2.0, chunk_kib=64)
        recorder = SessionRecorder(folder, SessionAbout(), config, clock.anchor(), disk=disk, clock=clock)
        recorder.start()
        for k in range(3):
            for message in second(k * S):
                recorder.offer(message)
            wait_for(lambda expected=292 * (k + 1): recorder.status().messages >= expected)
            clock.now_ns += 2 * S
            wait_for(lambda at=clock.now_ns: recorder.status().last_progress_ns >= at)
            last = max(folder.glob("*.active"))
            self.flushed.append((last.stat().st_size, recorder.status().messages))
        wait_for(lambda: (folder / f"{folder.name}_0.mcap").exists() and (folder / "metadata.yaml").exists())
        self.folder = root / "copy" / folder.name
        shutil.copytree(folder, self.folder)
        recorder.stop("operator")


@pytest.fixture(scope="module")
def cut_off(tmp_path_factory):
    return CutOff(tmp_path_factory.mktemp("cut"))


def active_of(folder):
    (path,) = folder.glob("*.mcap.active")
    return path


def test_any_cut_keeps_every_chunk_before_it(cut_off, tmp_path):
    whole = active_of(cut_off.folder).read_bytes()
    chooser = random.Random(7)
    chunk_ends, counts = complete_chunks(whole)
    for cut in [chooser.randrange(chunk_ends[0], len(whole)) for _ in range(25)]:
        path = tmp_path / f"cut_{cut}.mcap"
        path.write_bytes(whole[:cut])
        finish_in_place(path)
        expected = max(count for end, count in zip(chunk_ends, counts, strict=True) if end <= cut)
        with AnyReader([path]) as bag:
            assert bag.message_count == sum(1 for _ in bag.messages()) >= expected


def complete_chunks(data):
    """Ends of chunks in the file and messages up to there, by the library's streaming reader."""
    stream = io.BytesIO(data)
    ends, counts = [], []
    messages = 0
    try:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                ends.append(stream.tell())
                counts.append(messages)
            elif isinstance(record, MessageIndex):
                messages += len(record.records)
                counts[-1] = messages
    except McapError:
        pass
    return ends, counts


def test_start_up_finishes_what_was_open(cut_off, tmp_path):
    folder = tmp_path / cut_off.folder.name
    shutil.copytree(cut_off.folder, folder)
    active = active_of(folder)
    size = active.stat().st_size
    with active.open("ab") as stream:
        stream.write(bytes(1000))
    (repair,) = repair_leftovers(tmp_path)
    assert (repair.session, repair.error) == (folder.name, "")
    assert repair.file == active.name.removesuffix(".active")
    assert not list(folder.glob("*.active"))
    assert not (folder / ".reserve").exists()
    record = read_session(folder)
    assert record.state == "unclean"
    with AnyReader([folder]) as bag:
        counts = Counter(connection.topic for connection, _, _ in bag.messages())
    assert counts == Counter(record.counts)
    assert counts["/livox/imu"] == 600
    assert (folder / repair.file).stat().st_size > size - 1000
    assert repair_leftovers(tmp_path) == []


def test_a_file_with_nothing_in_it_is_set_aside(cut_off, tmp_path):
    folder = tmp_path / cut_off.folder.name
    shutil.copytree(cut_off.folder, folder)
    active = active_of(folder)
    active.write_bytes(b"")
    (repair,) = repair_leftovers(tmp_path)
    assert repair.error
    assert (folder / (active.name.removesuffix(".active") + ".damaged")).exists()
    assert read_session(folder).splits[0].file.endswith("_0.mcap")
    assert repair_leftovers(tmp_path) == []


def test_sessions_in_order_and_strangers_are_left_alone(tmp_path):
    clock = FakeClock()
    folder = session_folder(tmp_path, "fine", clock.anchor())
    recorder = SessionRecorder(folder, SessionAbout(), limits(), clock.anchor(), disk=FaultyDisk(), clock=clock)
    recorder.start()
    recorder.stop("operator")
    (tmp_path / "notes").mkdir()
    (tmp_path / "readme.txt").write_text("mine")
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    assert repair_leftovers(tmp_path) == []
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
    assert repair_leftovers(tmp_path / "not there") == []
