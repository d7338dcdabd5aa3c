"""The queue's room, its reserve, and its account of what was lost."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.messages import ImuSample, LidarScan, VideoFrame
from edge.recording.queue import RecordQueue, cost_bytes
from tests.edge.recording.recording_scene import MS, diagnostics, event, fix, imu, nmea, scan, video

KINDS = (imu, scan, fix, nmea, video, event, diagnostics)


def test_messages_come_out_in_order_and_free_their_room_once_written():
    queue = RecordQueue(1 << 20, 0)
    offered = [scan(k, 1000) for k in range(30)]
    assert all(queue.put(message) for message in offered)
    assert queue.take(0) == offered
    full = queue.fill()
    assert full > 0.5, "what the writer has in hand still takes room"
    assert queue.take(0) == []
    assert queue.fill() == 0


def test_newest_is_dropped_and_counted_by_kind():
    queue = RecordQueue(110_000, 0)
    taken = [queue.put(scan(k * MS, 1000)) for k in range(10)]
    assert taken == [True] * 5 + [False] * 5
    drops = queue.drops()[LidarScan]
    assert (drops.count, drops.first_ns, drops.last_ns) == (5, 6 * MS, 10 * MS)
    assert queue.new_drops()[LidarScan].count == 5
    assert queue.new_drops() == {}
    assert queue.drops()[LidarScan].count == 5


def test_scans_and_video_leave_the_reserve_to_small_messages():
    queue = RecordQueue(1 << 20, 25)
    while queue.put(video(0, 20_000)):
        pass
    assert 0.70 < queue.fill() <= 0.75
    assert not queue.put(scan(0, 5000))
    assert all(queue.put(make(0)) for make in (imu, fix, nmea, event, diagnostics))
    while queue.put(imu(0)):
        pass
    assert 0.99 < queue.fill() <= 1
    assert {kind: drops.count for kind, drops in queue.drops().items()} == {VideoFrame: 1, LidarScan: 1, ImuSample: 1}


def test_a_closed_queue_takes_no_more_and_counts_no_more():
    queue = RecordQueue(1 << 20, 0)
    queue.put(imu(0))
    queue.close()
    assert not queue.put(imu(1))
    assert queue.take(10) == [imu(0)]
    assert queue.drops() == {}


def test_abandoned_messages_are_lost_and_counted():
    queue = RecordQueue(1 << 20, 0)
    for k in range(5):
        queue.put(imu(k * MS))
    queue.abandon()
    assert queue.take(10) == []
    assert queue.drops()[ImuSample].count == 5


@given(
    st.lists(st.tuples(st.integers(0, len(KINDS) - 1), st.booleans()), max_size=200),
    st.integers(2_000, 60_000),
    st.floats(0, 50),
)
def test_every_message_is_taken_or_counted_and_the_bound_holds(steps, capacity, reserve):
    queue = RecordQueue(capacity, reserve)
    put = taken = 0
    in_hand: list = []
    for number, (kind, take) in enumerate(steps):
        put += 1
        queue.put(KINDS[kind](number))
        if take:
            in_hand = queue.take(0, 1)
            taken += len(in_hand)
        assert 0 <= queue.fill() <= 1
    while batch := queue.take(0):
        taken += len(batch)
    assert taken + sum(drops.count for drops in queue.drops().values()) == put
    assert queue.fill() == 0


def test_cost_covers_what_the_message_holds():
    big = scan(0, 20_000)
    arrays = (big.xyz_m, big.reflectivity, big.tag, big.line, big.offset_ns)
    assert cost_bytes(big) >= sum(array.nbytes for array in arrays)
    assert cost_bytes(video(0, 10_000)) >= 10_000
