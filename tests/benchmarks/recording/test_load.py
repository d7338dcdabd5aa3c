"""The canned load is what the sensors send: the drivers' own parsers read it, and nothing is missing."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.recording.camera import CANNED, _Frame, _mux
from benchmarks.recording.lidar import _canned
from benchmarks.recording.load import RETURNS_PER_PACKET, SENTENCES_PER_EPOCH, Load
from benchmarks.recording.receiver import EPOCH, _untimed
from benchmarks.recording.report import Results, Row, rows, text
from drivers.gopro.transport_stream import Demuxer
from drivers.livox.packets import decode, returned
from drivers.sim.reach_emulator_nmea import SentenceSet, sentences


@pytest.mark.parametrize("factor", [1, 5])
def test_point_packets_span_their_time_and_hold_the_share_of_returns(factor):
    load = Load(factor)
    for row in _canned(load)[:20]:
        packet = decode(row.tobytes())
        assert returned(packet.records, packet.data_type).sum() == RETURNS_PER_PACKET
        assert packet.time_interval * 100 == load.packet_ns - load.point_ns


def test_video_goes_on_from_one_canned_second_to_the_next():
    load = Load(5)
    frames = [_Frame(data) for data in _mux(load)]
    demuxer, counters, units = Demuxer(), {}, []
    for index in range(3 * CANNED):
        units += demuxer.feed(frames[index % CANNED].at(index * load.frame_90khz, counters), index)
    units += demuxer.flush()
    assert [unit.pts for unit in units] == [index * load.frame_90khz for index in range(3 * CANNED)]
    assert len({len(unit.data) for unit in units}) <= 4  # every frame whole


def test_an_epoch_has_eight_sentences():
    timed = sentences(EPOCH, 100_000_000, SentenceSet(satellites=False, velocity=False, date=False))[:3]
    assert len(timed) + len(_untimed()) == SENTENCES_PER_EPOCH


def test_load_is_two_hundred_thousand_points_a_second_and_five_times_that():
    assert 1e9 / Load(1).point_ns == 200_000
    assert 1e9 / Load(5).point_ns == 1_000_000
    assert np.isclose(90_000 / Load(5).frame_90khz, 150)


def test_a_missed_target_is_named():
    start = SimpleNamespace(reply_s=0.1, received_s=0.1, disk_s=0.7)
    results = Results("machine", "0 0 0", starts=(start,))
    assert [row.met for row in rows(results)] == [None, None, False]
    assert "MISSED" in text(results)
    assert isinstance(next(rows(results)), Row)
