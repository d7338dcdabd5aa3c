"""What a stream lost, from its counter and its times."""

import random

from drivers.livox.counter import PacketCounter, Verdict

PERIOD = 480_000


def packet(index: int, start_ns: int = 10**12, first: int = 0) -> tuple[int, int, int]:
    """(udp_cnt, sensor_ns, receive_ns) of the packet `index` of a stream without jitter."""
    return (first + index) % 65536, start_ns + index * PERIOD, 10**13 + index * PERIOD


def counted(indices: list[int], first: int = 0) -> PacketCounter:
    counter = PacketCounter(PERIOD)
    for index in indices:
        counter.take(*packet(index, first=first))
    return counter


def test_counts_through_the_wrap():
    counter = counted(list(range(1000)), first=65_000)
    assert (counter.received, counter.lost, counter.duplicates, counter.restarts) == (1000, 0, 0, 0)


def test_duplicate_and_late_packets_are_told_apart():
    counter = PacketCounter(PERIOD)
    verdicts = [counter.take(*packet(index)) for index in (0, 1, 1, 3, 2, 2, 4, 0)]
    new, late, duplicate = Verdict.NEW, Verdict.LATE, Verdict.DUPLICATE
    assert verdicts == [new, new, duplicate, new, late, duplicate, new, duplicate]
    assert (counter.received, counter.lost, counter.late, counter.duplicates) == (5, 0, 1, 3)


def test_random_loss_duplication_and_reordering_is_counted_exactly():
    chosen = random.Random(7)
    kept = [index for index in range(100_000) if index in (0, 99_999) or chosen.random() > 0.05]
    arrivals = [copy for index in kept for copy in [index] * (1 + (chosen.random() < 0.05))]
    for at in range(1, len(arrivals) - 2, 17):
        arrivals[at], arrivals[at + 1] = arrivals[at + 1], arrivals[at]
    counter = counted(arrivals)
    assert counter.received == len(kept)
    assert counter.lost == 100_000 - len(kept)
    assert counter.duplicates == len(arrivals) - len(kept)


def test_long_losses_are_resolved_by_time():
    for lost in (1, 1023, 1024, 5000, 65_535, 65_536, 65_537, 3 * 65_536 + 17):
        counter = counted([0, 1, 2 + lost, 3 + lost])
        assert (counter.lost, counter.restarts, counter.odd) == (lost, 0, 0), lost


def test_silence_without_loss_is_no_loss():
    """The device paused: its counter stood still while its clock went on."""
    for seconds in (7, 16, 40, 1000):
        counter = counted([0, 1])
        count, sensor_ns, receive_ns = packet(2)
        counter.take(count, sensor_ns + seconds * 10**9, receive_ns + seconds * 10**9)
        assert (counter.lost, counter.received) == (0, 3), seconds


def test_reboot_begins_a_new_line():
    counter = counted(list(range(100)), first=4000)
    verdicts = []
    for index in range(3):
        receive_ns = 10**13 + 9 * 10**9 + index * PERIOD
        verdicts.append(counter.take(index, 11 * 10**9 + index * PERIOD, receive_ns))
    assert verdicts == [Verdict.ODD, Verdict.JUMPED, Verdict.NEW]
    assert (counter.restarts, counter.jumps, counter.lost, counter.odd) == (1, 0, 0, 0)


def test_clock_jump_is_told_from_a_restart():
    for jump_ns in (2 * 10**9, -2 * 10**9, 1_700_000_000 * 10**9):
        counter = counted([0, 1, 2])
        verdicts = []
        for index in (3, 4, 5):
            count, sensor_ns, receive_ns = packet(index)
            verdicts.append(counter.take(count, sensor_ns + jump_ns, receive_ns))
        assert verdicts == [Verdict.ODD, Verdict.JUMPED, Verdict.NEW]
        assert (counter.restarts, counter.jumps, counter.lost) == (0, 1, 0)


def test_stragglers_from_before_a_jump_are_no_jump_back():
    counter = counted([0, 1, 2])
    jumped = [(count, sensor_ns + 3 * 10**9, receive_ns) for count, sensor_ns, receive_ns in map(packet, (6, 7, 8, 9))]
    verdicts = [counter.take(*each) for each in (*jumped[:2], packet(3), packet(4), packet(5), *jumped[2:])]
    odd, new = Verdict.ODD, Verdict.NEW
    assert verdicts == [odd, Verdict.JUMPED, odd, odd, odd, new, new]
    assert counter.jumps == 1


def test_one_damaged_packet_changes_nothing_but_its_own_loss():
    for damaged in ((30_000, *packet(3)[1:]), (3, 10**15, packet(3)[2]), (3, 0, packet(3)[2])):
        counter = counted([0, 1, 2])
        assert counter.take(*damaged) is Verdict.ODD
        assert counter.take(*packet(4)) is Verdict.NEW
        assert (counter.lost, counter.odd, counter.restarts, counter.jumps) == (1, 1, 0, 0)


def test_imu_jitter_is_no_loss():
    chosen = random.Random(3)
    counter = PacketCounter(5_000_000)
    for index in range(70_000):
        jitter_ns = chosen.randint(-950_000, 950_000)
        counter.take(index % 65536, 10**12 + index * 5_000_000 + jitter_ns, 10**13 + index * 5_000_000)
    assert (counter.received, counter.lost, counter.odd) == (70_000, 0, 0)
