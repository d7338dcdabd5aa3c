"""Sweeps get the inertial samples that cover them, whatever comes late, twice or not at all."""

from __future__ import annotations

import random

import numpy as np
import pytest

from drivers.messages import ImuSample, LidarScan
from edge.replay.pairing import Pairing

MS = 1_000_000


def scan(at_ms: int) -> LidarScan:
    octets = np.zeros((3, 2), np.uint8)
    return LidarScan(at_ms * MS, 0, np.ones((2, 3), np.float32), *octets, np.array([0, 99 * MS], np.uint32))


def sample(at_ms: int) -> ImuSample:
    return ImuSample(at_ms * MS, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 9.8))


def stamps_ms(sweep) -> list[int]:
    return [one.stamp_ns // MS for one in sweep.imu]


def sweeps(messages, *, flush: bool = True):
    pairing = Pairing()
    found = [sweep for message in messages for sweep in pairing.add(message)]
    return pairing, [*found, *(pairing.flush() if flush else ())]


def walk(scans: int):
    messages = [(k * 100, scan(k * 100)) for k in range(scans)] + [
        (t, sample(t)) for t in range(0, scans * 100 + 30, 5)
    ]
    return [message for _, message in sorted(messages, key=lambda one: one[0])]


def test_each_sample_is_given_once_up_to_the_first_past_the_end():
    _, found = sweeps(walk(4), flush=False)
    assert [sweep.scan.stamp_ns // MS for sweep in found] == [0, 100, 200, 300]
    assert stamps_ms(found[0]) == list(range(0, 101, 5))
    assert stamps_ms(found[1]) == list(range(105, 201, 5))


@pytest.mark.parametrize("seed", range(5))
def test_messages_out_of_order_within_the_patience_change_nothing(seed):
    chance = random.Random(seed)
    messages = walk(8)
    shuffled = sorted(
        messages, key=lambda m: m.stamp_ns / MS + chance.uniform(0, 19) + (120 if type(m) is LidarScan else 0)
    )
    pairing, found = sweeps(shuffled)
    _, expected = sweeps(messages)
    assert [(s.scan.stamp_ns, stamps_ms(s)) for s in found] == [(s.scan.stamp_ns, stamps_ms(s)) for s in expected]
    assert (pairing.left.scans, pairing.left.samples) == (0, 0)


def test_what_comes_too_late_or_twice_is_left_out_and_counted():
    pairing, found = sweeps([*walk(3), sample(50), sample(325), sample(325), scan(100), scan(100)])
    assert len(found) == 3
    assert (pairing.left.scans, pairing.left.samples) == (2, 3)


def test_without_inertial_data_a_scan_waits_for_its_patience_only():
    pairing = Pairing()
    given = [len(list(pairing.add(scan(k * 100)))) for k in range(8)]
    assert given == [0, 0, 0, 0, 0, 1, 1, 1]
    assert pairing.waiting == 5


def test_samples_without_scans_do_not_pile_up():
    pairing = Pairing()
    for k in range(20_000):
        assert not list(pairing.add(sample(k * 5)))
    assert len(next(iter(pairing.add(scan(99_800)))).imu) <= 4000


def test_a_stray_stamp_costs_itself_alone():
    messages = walk(8)
    _, expected = sweeps(messages)
    pairing, found = sweeps([*messages[:40], sample(100_000), *messages[40:60], scan(100_000), *messages[60:]])
    assert [(s.scan.stamp_ns, stamps_ms(s)) for s in found] == [(s.scan.stamp_ns, stamps_ms(s)) for s in expected]
    assert (pairing.left.scans, pairing.left.samples) == (1, 1)
