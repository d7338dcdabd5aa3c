"""The small parts: NAL units, PTS, status, watchdog, texts, USB."""

import io
import json

import av
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import SensorUnreachable
from drivers.gopro import h264, status, usb
from drivers.gopro.frames import FrameBuilder
from drivers.gopro.keepalive import KEEP_ALIVE, KeepAlive
from drivers.gopro.pts import WRAP, PtsTimeline, ticks_to_ns
from drivers.gopro.transport_stream import AccessUnit
from drivers.gopro.watchdog import StreamSigns, Watchdog
from tests.drivers.sources import tiny_units

FRAME_NS = 33_366_667


def test_keyframes_are_those_that_ffmpeg_sees():
    ours = [h264.kind(unit).entry for unit in tiny_units()]
    with av.open(io.BytesIO(b"".join(tiny_units())), format="h264") as container:
        theirs = [packet.is_keyframe for packet in container.demux() if packet.size]
    assert ours == theirs
    assert sum(ours) == 6


@given(st.binary(max_size=300))
def test_any_bytes_have_a_kind(data):
    assert h264.kind(data).entry in {True, False}


@given(origin=st.integers(0, WRAP - 1), steps=st.lists(st.integers(1, 40_000), min_size=1, max_size=50))
def test_time_goes_on_over_the_wrap(origin, steps):
    timeline, ticks = PtsTimeline(), origin
    timeline.place(origin, 0)
    for step in steps:
        ticks += step
        placed = timeline.place(ticks % WRAP, ticks_to_ns(ticks - origin))
        assert not placed.new_epoch
        assert placed.sensor_ns == ticks_to_ns(ticks)


@pytest.mark.parametrize(
    ("jump_ticks", "elapsed_ns", "restarted", "new_epoch"),
    [
        (3003, 3_000_000_000, False, False),  # a frame that was stuck in the network
        (270_000, 3_000_000_000, False, False),  # a hole in the stream
        (225_000, FRAME_NS, False, True),  # the camera's clock jumped
        (-900_000, FRAME_NS, False, True),
        (90_000, 1_000_000_000, True, False),  # restarted, the clock ran on
        (3003, 1_000_000_000, True, True),  # restarted, the clock had stood still
    ],
)
def test_a_new_epoch_is_told_from_a_hole(jump_ticks, elapsed_ns, restarted, new_epoch):
    timeline = PtsTimeline()
    timeline.place(5_000_000, 0)
    if restarted:
        timeline.restarted()
    assert timeline.place(5_000_000 + jump_ticks, elapsed_ns).new_epoch is new_epoch


def test_lost_frames_are_counted_by_their_missing_time():
    builder = FrameBuilder(0)
    for index in [0, 1, 2, 5, 6, 8]:
        builder.add(AccessUnit(tiny_units()[index], index * 3003, index * FRAME_NS))
    health = builder.tally.report(29.97)
    assert (health.received, health.lost) == (6, 3)


def test_frames_before_the_first_keyframe_are_dropped_also_after_a_long_hole_or_on_a_new_clock():
    builder = FrameBuilder(0)
    placed = [builder.add(AccessUnit(tiny_units()[k], k * 3003, k * FRAME_NS)) for k in range(3, 15)]
    assert [p.frame is not None for p in placed] == [False] * 7 + [True] * 5
    builder.restarted()
    assert builder.add(AccessUnit(tiny_units()[17], 17 * 3003, 17 * FRAME_NS)).frame is not None  # a short hole
    builder.restarted()
    assert builder.add(AccessUnit(tiny_units()[35], 35 * 3003, 35 * FRAME_NS)).frame is None
    assert builder.add(AccessUnit(tiny_units()[40], 40 * 3003, 40 * FRAME_NS)).frame is not None
    builder.restarted()
    assert builder.add(AccessUnit(tiny_units()[41], 5, 41 * FRAME_NS)).frame is None  # another clock


def test_a_known_latency_is_taken_off_the_stamp():
    frames = [
        FrameBuilder(latency).add(AccessUnit(tiny_units()[0], 90_000, 10**12)).frame for latency in (0, 5 * 10**8)
    ]
    assert frames[0].stamp_ns - frames[1].stamp_ns == 5 * 10**8


# Values of a real HERO8 on firmware 01.60, in its photo group and busy, as the reference sheet gives them (section 3).
HERO8_STATUS = {
    "1": 1, "2": 3, "3": 0, "4": 255, "6": 0, "8": 1, "9": 0, "10": 1, "13": 0, "17": 1, "31": 1, "32": 0, "33": 0,
    "34": 4342, "35": 3779, "36": 0, "37": 0, "38": 0, "39": 0, "40": "%14%05%1A%0B%30%02", "54": 31121632, "55": 0,
    "57": 422283, "60": 500, "68": 0, "69": 1, "70": 76, "82": 1, "89": 17, "96": 1001, "97": 65536,
}  # fmt: skip


def test_the_real_status_is_understood():
    read = status.read({"status": HERO8_STATUS, "settings": {"59": 0, "75": 3}})
    assert (read.busy, read.recording, read.ready, read.battery_percent, read.card) == (True, True, True, 76, "ok")
    assert read.card_free_bytes == 31_868_551_168
    assert (read.group, read.streaming, read.card_remaining_s) == (1001, False, 3779)
    assert status.troubles(read, True, 15, 600) == []


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.text(max_size=5) | st.floats(allow_nan=False),
        lambda inner: (
            st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["status", "settings", "8", "70"]), inner)
        ),
        max_leaves=10,
    )
)
def test_any_json_object_is_a_status(value):
    answer = json.loads(json.dumps(value))
    read = status.read(answer if isinstance(answer, dict) else {"status": answer})
    status.troubles(read, True, 15, 600)


def test_troubles_say_what_to_do_worst_first():
    ids = {"6": 1, "33": 2, "70": 9, "85": 1}
    found = status.troubles(status.read({"status": ids}), True, 15, 600)
    assert [trouble.problem for trouble in found] == [
        "The camera is too hot and may stop.",
        "The camera's card: removed.",
        "Camera battery at 9 %.",
        "The camera is cold; its battery may give in early.",
    ]
    assert all(trouble.advice for trouble in found)


def test_keep_alive_is_the_hero8s_every_two_and_a_half_seconds():
    assert len(KEEP_ALIVE) == 22
    pulse = KeepAlive()
    assert [t / 10 for t in range(100) if pulse.due(100 + t / 10)] == [0.0, 2.5, 5.0, 7.5]


def test_the_watchdog_tries_three_times_before_it_speaks():
    dog = Watchdog(stall_s=4.0, port=8554)
    dog.started(100.0)
    tries, said = [], []
    for now in range(100, 140):
        signs = StreamSigns(100.5, 100.5)
        if dog.starved(now, signs):
            tries.append(now)
            dog.started(now)
        if dog.trouble(now, signs, True):
            said.append(now)
    assert tries[:4] == [105, 110, 115, 126]
    assert said[0] == 115


def test_usb_address_comes_from_the_serial_or_from_the_interface(tmp_path):
    assert usb.address_of_serial("C3331350124851") == "172.28.151.51"
    device = tmp_path / "devices/1-2/1-2:1.0"
    device.mkdir(parents=True)
    (device.parent / "idVendor").write_text("2672\n")
    link = tmp_path / "net/enx0641690a0b0c"
    link.mkdir(parents=True)
    (link / "device").symlink_to(device)
    assert usb.find(tmp_path / "net", lambda name: "172.28.151.54") == "172.28.151.51"
    with pytest.raises(SensorUnreachable, match="no address"):
        usb.find(tmp_path / "net", lambda name: "10.42.0.1")
    with pytest.raises(SensorUnreachable, match="GoPro Connect"):
        usb.find(tmp_path / "nothing")
