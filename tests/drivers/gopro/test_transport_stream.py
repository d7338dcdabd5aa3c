"""The demuxer against FFmpeg's (through PyAV), against our own muxer, and against anything at all."""

import io
import itertools
import random
from fractions import Fraction
from pathlib import Path

import av
import pytest
from av.bitstream import BitStreamFilterContext
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.gopro.datagrams import DatagramOrder
from drivers.gopro.tables import crc32_mpeg
from drivers.gopro.transport_stream import Demuxer
from drivers.sim.transport_mux import AUDIO_PID, VIDEO_PID, TransportMux
from tests.drivers.sources import tiny_units

CLIP = Path(__file__).parents[3] / "../shared/data/gopro/max-heromode.mp4"
PACKET = 188


def muxed(units, first_pts=1000, audio=True):
    mux = TransportMux()
    out = b""
    for index, unit in enumerate(units):
        out += mux.video(unit, first_pts + 3003 * index)
        if audio:
            out += mux.audio(first_pts + 3003 * index)
    return out


def demuxed(data, cuts=()):
    demuxer = Demuxer()
    edges = [0, *sorted(cuts), len(data)]
    units = []
    for number, (start, end) in enumerate(itertools.pairwise(edges)):
        units += demuxer.feed(data[start:end], number)
    return units + demuxer.flush(), demuxer


def ffmpeg_packets(data):
    with av.open(io.BytesIO(data), format="mpegts") as container:
        return [(bytes(p), p.pts) for p in container.demux(container.streams.video[0]) if p.size]


def remuxed_clip():
    """The real clip as MPEG-TS, written by FFmpeg."""
    target = io.BytesIO()
    with av.open(str(CLIP)) as source, av.open(target, "w", format="mpegts") as out:
        video = source.streams.video[0]
        stream = out.add_stream_from_template(video)
        for packet in source.demux(video):
            if packet.size:
                packet.stream = stream
                out.mux(packet)
    return target.getvalue()


needs_clip = pytest.mark.skipif(not CLIP.exists(), reason="the real clip ../shared/data/gopro is not here")


@needs_clip
def test_the_real_clip_muxed_by_ffmpeg_gives_ffmpegs_own_packets():
    data = remuxed_clip()
    units, demuxer = demuxed(data, range(1316, len(data), 1316))
    assert [(unit.data, unit.pts) for unit in units] == ffmpeg_packets(data)
    assert len(units) == 315
    assert demuxer.losses.packets == demuxer.losses.units == demuxer.losses.skipped_bytes == 0


@needs_clip
def test_the_real_clip_through_our_muxer_is_read_alike_by_ffmpeg_and_by_us():
    with av.open(str(CLIP)) as source:
        video = source.streams.video[0]
        to_annex_b = BitStreamFilterContext("h264_mp4toannexb", video)
        clip = [bytes(out) for packet in source.demux(video) for out in to_annex_b.filter(packet) if out.size]
    data = muxed(clip)
    assert [unit.data for unit in demuxed(data)[0]] == clip
    assert [packet for packet, _ in ffmpeg_packets(data)] == clip


def test_our_stream_is_laid_out_as_a_hero8s_and_ffmpeg_decodes_it():
    data = muxed(tiny_units())
    with av.open(io.BytesIO(data), format="mpegts") as container:
        kinds = {stream.id: stream.codec_context.name for stream in container.streams if stream.codec_context}
        assert kinds[VIDEO_PID] == "h264"
        assert kinds[AUDIO_PID] == "aac"
        pictures = list(container.decode(container.streams.video[0]))
    assert len(pictures) == len(tiny_units())
    assert pictures[1].time_base * (pictures[1].pts - pictures[0].pts) == Fraction(1001, 30000)
    with av.open(io.BytesIO(data), format="mpegts") as container:
        sound = next(container.decode(container.streams.audio[0]))
    assert (sound.samples, sound.sample_rate, sound.layout.nb_channels) == (1024, 48000, 2)
    assert not sound.to_ndarray().any()


def test_crc_has_the_value_of_the_catalogue():
    assert crc32_mpeg(b"123456789") == 0x0376E6E7


@given(cuts=st.lists(st.integers(0, 40_000), max_size=40), head=st.binary(max_size=400))
@settings(max_examples=40)
def test_how_the_bytes_are_cut_makes_no_difference(cuts, head):
    data = head + muxed(tiny_units()[:12])
    whole, _ = demuxed(data)
    pieces, _ = demuxed(data, [cut for cut in cuts if cut < len(data)])
    assert [(unit.data, unit.pts) for unit in pieces] == [(unit.data, unit.pts) for unit in whole]
    assert [unit.data for unit in whole][-10:] == list(tiny_units()[2:12])


@given(st.lists(st.binary(max_size=600), max_size=20))
@settings(max_examples=60)
def test_nothing_makes_it_raise(chunks):
    demuxed(b"".join(chunks), range(0, sum(map(len, chunks)), 97))


@given(seed=st.integers(0, 1 << 30))
@settings(max_examples=40)
def test_damage_never_raises_and_never_makes_up_an_access_unit(seed):
    chance = random.Random(seed)
    data = muxed(tiny_units()[:30])
    packets = [data[at : at + PACKET] for at in range(0, len(data), PACKET)]
    hurt = []
    for packet in packets:
        fate = chance.random()
        if fate < 0.03:
            continue
        hurt += [packet] * 2 if fate < 0.06 else [packet]
        if fate > 0.97:
            hurt.append(chance.randbytes(chance.randrange(400)))
    units, demuxer = demuxed(b"".join(hurt))
    whole = set(tiny_units())
    assert all(unit.data in whole for unit in units[:-1])  # nothing tells that the very last one lost its end
    assert len(units) + demuxer.losses.units <= 30


@given(seed=st.integers(0, 1 << 30))
@settings(max_examples=30)
def test_flipped_bits_never_raise(seed):
    chance = random.Random(seed)
    data = bytearray(muxed(tiny_units()[:10]))
    for _ in range(60):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    demuxed(bytes(data), range(0, len(data), 500))


def test_the_arrival_time_is_that_of_the_first_byte():
    data = muxed(tiny_units()[:3], audio=False)
    demuxer = Demuxer()
    units = [unit for at in range(0, len(data), 100) for unit in demuxer.feed(data[at : at + 100], at)]
    units += demuxer.flush()
    starts = [at for at in range(0, len(data), PACKET) if data[at + 1] & 0x5F == 0x50 and data[at + 2] == 0x11]
    assert [unit.receive_ns for unit in units] == [start // 100 * 100 for start in starts]


def test_33_bits_of_pts_survive():
    top = (1 << 33) - 1
    data = TransportMux().video(tiny_units()[0], top)
    assert demuxed(data)[0][0].pts == top
    assert ffmpeg_packets(data)[0][1] % (1 << 33) == top


def test_a_pes_that_announces_its_length_needs_no_successor():
    unit = tiny_units()[1]
    data = TransportMux().video(unit, 5)
    length = (len(unit) + 8).to_bytes(2, "big")
    at = data.index(b"\x00\x00\x01\xe0\x00\x00")
    data = data[: at + 4] + length + data[at + 6 :]
    assert [found.data for found in Demuxer().feed(data + b"\x47", 0)] == [unit]


def datagrams(data):
    return [data[at : at + 1316] for at in range(0, len(data), 1316)]


def through_order(pieces):
    order, demuxer, units = DatagramOrder(), Demuxer(), []
    for number, piece in enumerate(pieces):
        for arrived, ns in order.accept(piece, number):
            units += demuxer.feed(arrived, ns)
        order.video_pid = demuxer.video_pid
    for arrived, ns in order.release():
        units += demuxer.feed(arrived, ns)
    return units + demuxer.flush(), order


@given(
    swaps=st.sets(st.integers(2, 40)), copies=st.sets(st.integers(0, 40)), rubbish=st.binary(min_size=1, max_size=900)
)
@settings(max_examples=40)
def test_swapped_neighbours_copies_and_rubbish_cost_nothing(swaps, copies, rubbish):
    pieces = datagrams(muxed(tiny_units()))
    for at in sorted(swaps):
        if at + 1 < len(pieces) and not {at - 1, at - 2} & swaps:
            pieces[at], pieces[at + 1] = pieces[at + 1], pieces[at]
    sent = [copy for at, piece in enumerate(pieces) for copy in [piece] * (2 if at in copies else 1)]
    sent[5:5] = [rubbish]
    units, order = through_order(sent)
    assert [unit.data for unit in units] == list(tiny_units())
    assert order.counts.rubbish == 1


def test_a_sender_that_cuts_its_stream_elsewhere_is_understood_too():
    data = muxed(tiny_units())
    units, _ = through_order([data[at : at + 1000] for at in range(0, len(data), 1000)])
    assert [unit.data for unit in units] == list(tiny_units())
