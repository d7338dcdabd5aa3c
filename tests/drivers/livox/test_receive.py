"""The receiving side: whose datagrams, when, and how many were dropped."""

import socket
import struct
import threading
import time

import pytest

from drivers.errors import SensorUnreachable
from drivers.livox.receive import BLOCK_SLOTS, BLOCKS, SO_TIMESTAMPNS, Receiver, Source, _arrival_ns
from tests.drivers.livox.rig import addresses
from tests.waiting import wait_for


def sender(address: str) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind((address, 0))
    return made


@pytest.fixture
def setting():
    """A receiver on two ports, its LiDAR, and the event that stops it; the thread is started by the test."""
    lidar, host = addresses()
    receiver, stop = Receiver(), threading.Event()
    receiver.open(host, (56301, 56401), 1 << 20)
    receiver.accept_from(lidar)
    thread = threading.Thread(target=receiver.run, args=(stop,))
    with sender(lidar) as device:
        yield receiver, device, host, thread
    stop.set()
    if thread.ident is not None:
        thread.join()
    receiver.close()


def test_takes_the_lidars_datagrams_in_order_and_nobody_elses(setting):
    receiver, device, host, thread = setting
    thread.start()
    before_ns = time.monotonic_ns()
    with sender("127.0.0.1") as stranger:
        for number in range(300):
            device.sendto(number.to_bytes(2, "little"), (host, 56301))
            if number % 3 == 0:
                stranger.sendto(b"not yours", (host, 56301))
    got, stamps = [], []

    def take() -> bool:
        while (block := receiver.take()) is not None:
            got.extend(int.from_bytes(row[:2], "little") for row in block.rows[: len(block)])
            stamps.extend(block.receive_ns)
            receiver.give_back(block)
        return len(got) >= 300

    wait_for(take)
    assert got == list(range(300))
    assert receiver.foreign == 100
    assert stamps == sorted(stamps)
    assert before_ns - 1_000_000 <= stamps[0]
    assert stamps[-1] <= time.monotonic_ns()


def test_what_the_decoder_leaves_waits_and_then_the_kernel_counts_what_it_drops(setting):
    receiver, device, host, thread = setting
    thread.start()
    room = BLOCK_SLOTS * BLOCKS
    for _ in range(room // 200 + 40):
        for _ in range(200):
            device.sendto(bytes(1380), (host, 56301))
        receiver.wait(0.02)

    def taken() -> int:
        count = 0
        while (block := receiver.take()) is not None:
            count += len(block)
            receiver.give_back(block)
        return count

    first = taken()
    assert BLOCK_SLOTS <= first <= room
    wait_for(lambda: (device.sendto(b"x", (host, 56301)), taken(), receiver.kernel_drops)[-1] > 0)


def test_longer_datagrams_than_any_packet_are_marked(setting):
    receiver, device, host, thread = setting
    thread.start()
    device.sendto(bytes(5000), (host, 56401))
    wait_for(lambda: receiver.wait(0.1))
    block = receiver.take()
    assert block is not None
    assert block.lengths == [0]


def test_address_this_host_does_not_have_is_named_with_advice():
    with pytest.raises(SensorUnreachable, match=r"192\.0\.2\.7.*check host_address"):
        Receiver().open("192.0.2.7", (56301,), 1 << 20)


@pytest.mark.parametrize(("step_s", "expected_ns"), [(0, 5_000), (3600, 9_000), (-3600, 1_000)])
def test_a_step_of_the_hosts_clock_moves_a_stamp_no_further_than_the_socket_allows(monkeypatch, step_s, expected_ns):
    """Arrived at 5 us by the kernel; the socket was empty at 1 us and is read at 9 us."""
    monkeypatch.setattr(time, "monotonic_ns", lambda: 9_000)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unused:
        source = Source(unused, 0, not_before_ns=1_000)
        stamp = struct.pack("@qq", 7200 + step_s, 5_000)
        assert _arrival_ns(source, [(socket.SOL_SOCKET, SO_TIMESTAMPNS, stamp)], -7200 * 10**9) == expected_ns
