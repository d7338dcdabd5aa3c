"""A disk that stalls, fills up, breaks or is nearly full, and what a recording makes of it."""

import errno

import pytest
from rosbags.highlevel import AnyReader

from edge.errors import ConfigError, RecordingError
from edge.recording.account import SessionAbout
from edge.recording.folder import read_session
from edge.recording.session import SessionRecorder, session_folder
from edge.ros.decode import decode_log
from tests.edge.recording.recording_scene import FakeClock, FaultyDisk, S, imu, limits, scan, second
from tests.waiting import wait_for

FULL_RATE = {"points": 20_000, "video_bytes": 10_000}


def started(root, disk, config=None):
    clock = FakeClock()
    folder = session_folder(root, "faults", clock.anchor())
    recorder = SessionRecorder(folder, SessionAbout(), config or limits(), clock.anchor(), disk=disk, clock=clock)
    recorder.start()
    return recorder, clock


def count(folder):
    """Messages an independent reader finds, by topic."""
    with AnyReader([folder]) as bag:
        assert sum(1 for _ in bag.messages()) == bag.message_count
        return {topic: info.msgcount for topic, info in bag.topics.items() if info.msgcount}


def events(folder):
    with AnyReader([folder]) as bag:
        chosen = [one for one in bag.connections if one.topic == "/events"]
        return [decode_log(raw) for _, _, raw in bag.messages(chosen)]


def stall(recorder, clock, seconds, **rate):
    """A sync that takes `seconds`, while the sensors go on."""
    pending = [None]

    def hook(path):
        if pending and path.name.endswith(".active"):
            pending.clear()
            for k in range(seconds):
                for message in second(S + k * S, **rate):
                    recorder.offer(message)
            clock.now_ns += seconds * S

    return hook


def test_seven_seconds_of_stall_at_full_rate_lose_nothing_with_default_settings(tmp_path):
    disk = FaultyDisk()
    recorder, clock = started(tmp_path, disk)
    disk.on_sync = stall(recorder, clock, 7, **FULL_RATE)
    for message in second(0, **FULL_RATE):
        recorder.offer(message)
    clock.now_ns = S
    wait_for(lambda: recorder.status().flush_worst_ms >= 7000)
    result = recorder.stop("operator")
    assert result.dropped == {}
    found = count(result.folder)
    assert found["/livox/lidar"] == 80
    assert found["/livox/imu"] == 1600
    assert found["/camera/video"] == 240
    assert sum(found.values()) == result.messages


def test_a_stall_too_long_loses_scans_not_imu_and_says_so_in_the_file(tmp_path):
    disk = FaultyDisk()
    recorder, clock = started(tmp_path, disk, limits(queue_mib=4, reserve_percent=50.0))
    disk.on_sync = stall(recorder, clock, 7, points=2000)
    for message in second(0, points=2000):
        recorder.offer(message)
    clock.now_ns = S
    wait_for(lambda: recorder.status().flush_worst_ms >= 7000)
    status = recorder.status()
    result = recorder.stop("operator")
    assert set(result.dropped) <= {"/livox/lidar", "/camera/video"}
    lost = result.dropped["/livox/lidar"].count
    found = count(result.folder)
    assert status.dropped["/livox/lidar"].count == lost > 0
    assert found["/livox/lidar"] + lost == 80
    assert found["/livox/imu"] == 1600
    texts = [log.text for log in events(result.folder) if log.name == "recorder"]
    assert any(text.startswith(f"dropped {lost} messages of /livox/lidar") for text in texts)
    assert read_session(result.folder).dropped == result.dropped


def test_a_hanging_disk_shows_in_the_heartbeat(tmp_path):
    disk = FaultyDisk()
    recorder, clock = started(tmp_path, disk)
    seen = []

    def hook(_):
        before = recorder.status().last_progress_ns
        clock.now_ns += 20 * S
        seen.append(recorder.status().last_progress_ns - before)

    disk.on_sync = hook
    clock.now_ns = S
    wait_for(lambda: seen)
    assert seen[0] == 0
    recorder.stop("operator")


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO])
def test_a_disk_that_refuses_ends_the_session_with_everything_so_far(tmp_path, code):
    disk = FaultyDisk()
    recorder, clock = started(tmp_path, disk)
    for message in second(0):
        recorder.offer(message)
    wait_for(lambda: recorder.status().messages > 290)
    synced = []
    disk.on_sync = synced.append
    clock.now_ns = S
    wait_for(lambda: synced)
    flushed = recorder.status().bytes_written

    def broken(path):
        if path.name.endswith(".active"):
            raise OSError(code, "the disk says no")

    if code == errno.ENOSPC:
        disk.quota_bytes = 100_000
    else:
        disk.on_write = broken
    for k in range(1, 4):
        for message in second(k * S):
            recorder.offer(message)
    clock.now_ns += S
    wait_for(lambda: recorder.status().ended)
    result = recorder.stop("operator")
    assert result.reason == "disk error"
    assert "Check the card" in result.error
    found = count(result.folder)
    assert sum(found.values()) >= 292
    assert (result.folder / result.splits[0]).stat().st_size >= flushed
    assert result.counts == found
    queued = sum(drops.count for drops in result.dropped.values())
    assert sum(found.values()) - found["/tf_static"] + result.not_kept + queued == len(second(0)) * 4
    assert result.not_kept + queued > 0


def test_recording_stops_at_the_reserve_and_says_why(tmp_path):
    disk = FaultyDisk()
    disk.free_bytes = 3 << 30
    recorder, clock = started(tmp_path, disk, limits(min_free_mib=2048))
    for message in second(0):
        recorder.offer(message)
    disk.free_bytes = 2 << 30
    clock.now_ns = S
    wait_for(lambda: recorder.status().last_progress_ns >= S)
    assert recorder.status().ended == ""
    disk.free_bytes -= 1
    clock.now_ns += S
    wait_for(lambda: recorder.status().ended)
    recorder.offer(imu(3 * S))
    result = recorder.stop("operator")
    assert result.reason.startswith("disk reserve reached: 2047 MiB free, 2048 MiB are kept")
    assert result.error == ""
    assert result.dropped == {}
    assert count(result.folder)["/livox/imu"] == 200
    assert any(log.level == 40 and "disk reserve" in log.text for log in events(result.folder))


def test_a_percentage_can_be_the_larger_reserve(tmp_path):
    disk = FaultyDisk()
    disk.free_bytes = 30 << 30
    with pytest.raises(RecordingError, match="30720 MiB free, 31457 MiB must stay free"):
        started(tmp_path, disk, limits(min_free_mib=2048, min_free_percent=3.0))
    assert list(tmp_path.iterdir()) == []


def test_a_missing_card_is_refused(tmp_path):
    class NoCard(FaultyDisk):
        def on_own_mount(self, folder):
            return False

    with pytest.raises(RecordingError, match="no card is mounted"):
        started(tmp_path, NoCard(), limits(require_mount=True))


def test_a_folder_that_cannot_be_made_is_refused_in_words(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match=r"cannot be written.*Check the card"):
        started(tmp_path / "file" / "below", FaultyDisk())


def test_an_unknown_compression_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="expected one of none, lz4, zstd"):
        started(tmp_path, FaultyDisk(), limits(compression="gzip"))


def test_a_message_that_cannot_be_encoded_costs_only_itself(tmp_path):
    recorder, _ = started(tmp_path, FaultyDisk())
    recorder.offer(imu(0))
    recorder.offer(imu(10**20))
    recorder.offer("not a message")  # type: ignore[arg-type]
    recorder.offer(scan(S))
    result = recorder.stop("operator")
    assert result.error == ""
    assert result.dropped["/livox/imu"].count == 1
    assert count(result.folder)["/livox/imu"] == 1
    assert count(result.folder)["/livox/lidar"] == 1


def test_nothing_offered_is_still_a_recording_that_opens(tmp_path):
    recorder, _ = started(tmp_path, FaultyDisk())
    result = recorder.stop("operator")
    assert count(result.folder) == {"/tf_static": 1}


def test_a_split_that_cannot_be_closed_is_told_while_recording_goes_on(tmp_path):
    disk = FaultyDisk()

    class Reluctant(FaultyDisk):
        def rename(self, old, new):
            if new.name.endswith("_0.mcap"):
                raise OSError(errno.EIO, "Input/output error")
            super().rename(old, new)

    disk = Reluctant()
    recorder, _ = started(tmp_path, disk, limits(split_s=1.0))
    for k in range(3):
        for message in second(k * S):
            recorder.offer(message)
    result = recorder.stop("operator")
    assert "Input/output error" in result.error
    assert result.reason == "operator"
    assert len(result.splits) == 2
    assert (result.folder / f"{result.session}_0.mcap.active").exists()
    assert count(result.folder)["/livox/imu"] == 400
