"""What the writer does with time: splits by size, clock steps, many threads, and a stall in real time."""

import threading
from collections import Counter

from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from edge.config import Topics
from edge.recording import writer as writer_module
from edge.recording.account import SessionAbout
from edge.recording.anchor import Anchor
from edge.recording.bag import read_facts
from edge.recording.disk import Disk, DiskFile
from edge.recording.folder import read_session
from edge.recording.session import SessionRecorder, session_folder
from edge.ros.decode import decode_log
from tests.edge.recording.recording_scene import MS, FakeClock, FaultyDisk, S, imu, limits, scan, second, video
from tests.waiting import wait_for


def started(root, config=None, disk=None, clock=None):
    anchor = clock.anchor() if clock else Anchor.now()
    folder = session_folder(root, "writer", anchor)
    recorder = SessionRecorder(
        folder,
        SessionAbout(),
        config or limits(),
        anchor,
        disk=disk or FaultyDisk(),
        **({"clock": clock} if clock else {}),
    )
    recorder.start()
    return recorder


def test_splits_by_size(tmp_path):
    recorder = started(tmp_path, limits(split_mib=1, chunk_kib=128), clock=FakeClock())
    for k in range(40):
        recorder.offer(video(k * 33 * MS, 100_000))
    result = recorder.stop("operator")
    sizes = [(result.folder / name).stat().st_size for name in result.splits]
    assert len(sizes) == 4
    assert all(1 << 20 <= size < (1 << 20) + 200_000 for size in sizes[:-1])
    assert result.counts["/camera/video"] == 40


def test_a_message_larger_than_a_chunk_gets_one_of_its_own(tmp_path):
    recorder = started(tmp_path, limits(chunk_kib=16), clock=FakeClock())
    for k, size in enumerate((100, 100_000, 100)):
        recorder.offer(video(k * MS, size))
    result = recorder.stop("operator")
    with (result.folder / result.splits[0]).open("rb") as stream:
        sizes = [one.uncompressed_size for one in make_reader(stream).get_summary().chunk_indexes]
    assert sorted(size > 16 << 10 for size in sizes) == [False, False, False, True]


def test_facts_read_from_the_file_are_those_kept_while_writing(tmp_path):
    recorder = started(tmp_path, limits(split_s=1.0), clock=FakeClock())
    for k in range(2):
        for message in second(k * S):
            recorder.offer(message)
    result = recorder.stop("operator")
    for facts in read_session(result.folder).splits:
        found, channels = read_facts(result.folder / facts.file)
        assert found.counts == facts.counts
        assert (found.start_ns, found.end_ns, found.size_bytes) == (facts.start_ns, facts.end_ns, facts.size_bytes)
        assert len(channels) == len(Topics.__struct_fields__)


def test_a_step_of_the_system_clock_is_an_event_and_moves_no_stamp(tmp_path, monkeypatch):
    clock = FakeClock()
    step_ns = [0]

    def stepped(cls=None):
        return Anchor(clock.anchor().utc_ns + clock() + step_ns[0], clock())

    monkeypatch.setattr(writer_module.Anchor, "now", stepped)
    recorder = started(tmp_path, clock=clock)
    recorder.offer(imu(0))
    clock.now_ns = S
    wait_for(lambda: recorder.status().last_progress_ns >= S)
    step_ns[0] = -3600 * S
    clock.now_ns = 3 * S
    wait_for(lambda: recorder.status().messages >= 3)
    recorder.offer(imu(3 * S))
    result = recorder.stop("operator")
    with AnyReader([result.folder]) as bag:
        found = [(connection.topic, log_ns, raw) for connection, log_ns, raw in bag.messages()]
    logs = [decode_log(raw).text for topic, _, raw in found if topic == "/events"]
    assert logs == ["system clock stepped by -3600.000 s; session time goes on"]
    assert [log for topic, log, _ in found if topic == "/livox/imu"] == [
        clock.anchor().utc_ns + MS,
        clock.anchor().utc_ns + 3 * S + MS,
    ]
    clock_note = read_session(result.folder).clock
    assert (clock_note.steps, round(clock_note.drift_ms)) == (1, -3_600_000)


def test_four_threads_offering_at_once_lose_nothing(tmp_path):
    recorder = started(tmp_path, clock=FakeClock())
    makers = (imu, video, imu, scan)

    def feed(make):
        for k in range(500):
            recorder.offer(make(k * MS))

    threads = [threading.Thread(target=feed, args=(make,)) for make in makers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    result = recorder.stop("operator")
    assert result.counts == {"/tf_static": 1, "/livox/imu": 1000, "/camera/video": 500, "/livox/lidar": 500}


class StallingFile(DiskFile):
    """Its first sync takes as long as the test says."""

    def __init__(self, path, stalled, released):
        super().__init__(path)
        self._stalled, self._released = stalled, released

    def sync(self):
        self._stalled.set()
        self._released.wait()
        super().sync()


class StallingDisk(Disk):
    def __init__(self):
        self.stalled, self.released = threading.Event(), threading.Event()

    def create(self, path):
        if not path.name.endswith(".active"):
            return super().create(path)
        return StallingFile(path, self.stalled, self.released)


def test_a_stall_in_real_time_on_a_real_disk_loses_nothing(tmp_path):
    disk = StallingDisk()
    recorder = started(tmp_path, limits(flush_s=0.2), disk=disk)
    base = Anchor.now().monotonic_ns
    for k in range(10):
        recorder.offer(imu(base + k * MS))
    wait_for(disk.stalled.is_set)
    silent_since = recorder.status().last_progress_ns
    pause = threading.Event()
    for k in range(40):
        recorder.offer(scan(base + k * 25 * MS, 5000))
        recorder.offer(imu(base + k * 25 * MS))
        pause.wait(0.025)
    status = recorder.status()
    assert status.queue_fill > 0
    assert status.last_progress_ns == silent_since, "the heartbeat stands still while the disk hangs"
    disk.released.set()
    result = recorder.stop("operator")
    assert (result.dropped, result.error) == ({}, "")
    with AnyReader([result.folder]) as bag:
        counts = Counter(connection.topic for connection, _, _ in bag.messages())
    assert counts == {"/tf_static": 1, "/livox/imu": 50, "/livox/lidar": 40}
    assert read_session(result.folder).flush_worst_ms > 500


def test_a_fault_of_our_own_ends_the_session_readable_and_in_words(tmp_path, monkeypatch):
    recorder = started(tmp_path, clock=FakeClock())
    for k in range(100):
        recorder.offer(video(k * MS, 100_000))
    wait_for(lambda: recorder.status().messages == 101)
    monkeypatch.setattr(writer_module.SessionWriter, "_write", lambda *_: 1 / 0)
    recorder.offer(imu(S))
    wait_for(lambda: recorder.status().ended)
    result = recorder.stop("operator")
    assert "ZeroDivisionError" in result.error
    with AnyReader([result.folder]) as bag:
        assert bag.message_count == sum(result.counts.values()) >= 90
    assert result.dropped["/livox/imu"].count == 1
    assert result.counts["/camera/video"] + result.not_kept == 100
