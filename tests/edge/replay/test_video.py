"""Wanted images out of H.264, whatever is broken in it, and no more decoding than they need."""

from __future__ import annotations

import random
from pathlib import Path

import av
import numpy as np
import pytest
from av.bitstream import BitStreamFilterContext

from edge.replay.video import Frame, LazyDecoder
from tests.edge.replay import videos

REAL = Path(__file__).parents[3] / "../shared/data/gopro/max-heromode.mp4"


def everything(_stamp_ns: int) -> bool:
    return True


def read(units, choose=everything) -> tuple[list[Frame], LazyDecoder]:
    decoder = LazyDecoder()
    frames = [frame for stamp, unit in units for frame in decoder.add(stamp, unit, choose)]
    return frames + decoder.flush(), decoder


def indices(frames) -> list[int]:
    """Each frame shows the number that it is stamped with."""
    assert [videos.index_of(frame.image_bgr) for frame in frames] == [frame.stamp_ns for frame in frames]
    return [frame.stamp_ns for frame in frames]


def test_every_frame_has_its_own_stamp():
    frames, decoder = read(videos.units(35))
    assert indices(frames) == list(range(35))
    assert not decoder.tally.told


@pytest.mark.parametrize("wanted", [{0, 20}, {4, 5, 31}, {9, 10}, {34}])
def test_only_what_a_wanted_frame_leans_on_is_decoded(wanted):
    frames, decoder = read(videos.units(35), wanted.__contains__)
    assert indices(frames) == sorted(wanted)
    needed = {k for one in wanted for k in range(one - one % videos.GROUP, one + 1)}
    assert decoder.tally.decoded == len(needed)


def test_reordered_frames_keep_their_stamps():
    units = videos.units(35, videos.REORDERED)
    assert [index for index, _ in units] != sorted(index for index, _ in units)
    frames, _ = read(units)
    assert indices(frames) == list(range(35))
    frames, _ = read(units, {3, 8, 21, 34}.__contains__)
    assert indices(frames) == [3, 8, 21, 34]


def test_a_stream_that_begins_in_the_middle_waits_for_its_key_frame():
    frames, decoder = read(videos.units(35)[4:])
    assert indices(frames) == list(range(10, 35))
    assert decoder.tally.orphans == 6
    assert "6 frames of the video left out" in decoder.tally.told[0]


@pytest.mark.parametrize(
    ("lost", "left_out"),
    [({13}, range(13, 20)), ({9}, [9]), ({10}, range(10, 20)), ({14, 15, 22}, [*range(14, 20), *range(22, 30)])],
)
def test_after_a_lost_frame_none_that_leans_on_it_is_given(lost, left_out):
    frames, decoder = read([unit for unit in videos.units(35) if unit[0] not in lost])
    assert indices(frames) == sorted(set(range(35)) - set(left_out))
    assert decoder.tally.holes == len({k // 10 for k in lost}) - (lost == {9})


@pytest.mark.parametrize("seed", range(5))
def test_a_damaged_unit_is_counted_and_nothing_smeared_is_given(seed):
    rng = random.Random(seed)
    units = videos.encoded(videos.noise(seed, 30))
    clean, _ = read(units)
    frames, decoder = read([(k, damaged(unit, rng) if k in (7, 15) else unit) for k, unit in units])
    assert decoder.tally.damaged in (1, 2)
    assert {*range(7), *range(10, 15), *range(20, 30)} <= {frame.stamp_ns for frame in frames}
    for frame in frames:
        if frame.stamp_ns not in (*range(7, 10), *range(15, 20)):
            np.testing.assert_array_equal(frame.image_bgr, clean[frame.stamp_ns].image_bgr)


def damaged(unit: bytes, rng) -> bytes:
    octets = bytearray(unit)
    for _ in range(20):
        octets[rng.randrange(60, len(octets))] ^= 1 << rng.randrange(8)
    return bytes(octets)


@pytest.mark.parametrize(("share", "counted"), [(0.0, 2), (0.01, 1), (0.5, 1), (0.95, 1)])
def test_a_unit_that_is_cut_off_costs_what_leans_on_it(share, counted):
    units = videos.encoded(videos.noise(3, 30))
    units[12] = (12, units[12][1][: int(share * len(units[12][1]))])
    frames, decoder = read(units)
    assert decoder.tally.damaged + decoder.tally.holes == counted
    assert [frame.stamp_ns for frame in frames] == [*range(12), *range(20, 30)]


def test_parameter_sets_that_come_only_once_are_remembered():
    once = {"tune": "zerolatency", "x264-params": "annexb=1:repeat-headers=0:scenecut=0"}
    units = videos.encoded(videos.noise(3, 40), once)
    first = (0, videos.units(1)[0][1])  # has them, in a picture of its own
    units = [first, *[(k, unit) for k, unit in units if k >= 10]]
    units[7] = (units[7][0], units[7][1][:200])
    frames, decoder = read(units)
    assert decoder.tally.damaged == 1
    assert {frame.stamp_ns for frame in frames} >= {0, 10, 11, 20, 30, 39}


def test_garbage_between_the_units_is_no_reason_to_stop():
    rng = random.Random(1)
    units = [part for k, unit in videos.units(30) for part in ((k, unit), (-1, rng.randbytes(rng.randrange(200))))]
    frames, _ = read(units)
    assert {10, 20} <= {frame.stamp_ns for frame in frames}


@pytest.mark.skipif(not REAL.exists(), reason="the real camera file is not here")
def test_a_real_camera_has_no_holes_but_those_that_are_made():
    units = list(enumerate(real_units()))
    frames, decoder = read(units, lambda k: k % 15 == 0)
    assert [frame.stamp_ns for frame in frames] == list(range(0, 315, 15))
    assert decoder.tally.told == ()
    assert decoder.tally.decoded < 80
    frames, decoder = read([unit for unit in units if unit[0] not in (33, 108)])
    assert decoder.tally.holes == 2
    assert len(frames) == 315 - 7 - 2


def real_units():
    with av.open(str(REAL)) as container:
        stream = container.streams.video[0]
        annex_b = BitStreamFilterContext("h264_mp4toannexb", stream)
        for packet in container.demux(stream):
            if packet.size:
                yield from (bytes(one) for one in annex_b.filter(packet))
