"""The emulated camera itself: its state, its clock, its truth."""

import itertools
import json
import socket
from pathlib import Path
from random import Random

import av
import pytest

from drivers.errors import SimulationError
from drivers.gopro.api import Camera
from drivers.gopro.keepalive import KEEP_ALIVE
from drivers.gopro.transport_stream import Demuxer
from drivers.sim.clip import ClipSource
from drivers.sim.faults import FaultPlan, parse
from drivers.sim.gopro_device import Hero8, Quirks
from drivers.sim.gopro_line import BadLine, StreamClock
from tests.drivers.gopro.rig import STREAM_PORT, emulator, loopback_address
from tests.waiting import PATIENCE_S, wait_for

CLIP = Path(__file__).parents[3] / "../shared/data/gopro/max-heromode.mp4"
RESTART = "/gp/gpControl/execute?p1=gpStream&c1=restart"


class Time:
    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


def test_the_picture_freezes_without_keep_alive_and_comes_back_with_it():
    time = Time()
    camera = Hero8(time)
    camera.ask(RESTART, "127.0.0.9")
    time.now += 24.0
    assert camera.stream_to == "127.0.0.9"
    camera.heard(b"_GPHD_:0:0:2:0.000000\n")  # of older models
    time.now += 1.0
    assert camera.stream_to is None
    camera.heard(KEEP_ALIVE)
    assert camera.stream_to == "127.0.0.9"


def test_recording_counts_files_battery_and_card():
    time = Time()
    camera = Hero8(time)

    def status():
        return json.loads(camera.ask("/gp/gpControl/status", "").body, strict=False)["status"]

    before = status()
    camera.ask("/gp/gpControl/command/set_mode?p=1000", "")
    assert camera.ask("/gp/gpControl/command/shutter?p=1", "").code == 500  # busy
    time.now += 1.0
    assert camera.ask("/gp/gpControl/command/shutter?p=1", "").code == 200
    time.now += 600.0
    assert (status()["10"], status()["13"]) == (1, 600)
    assert camera.ask("/gp/gpControl/setting/59/0", "").code == 500
    camera.ask("/gp/gpControl/command/shutter?p=0", "")
    time.now += 1.0
    after = status()
    assert (after["10"], after["39"]) == (0, before["39"] + 1)
    assert after["70"] < before["70"]
    assert before["54"] - after["54"] == pytest.approx(600 * 5600, rel=0.01)


def test_status_has_the_real_key_set_and_line_breaks():
    body = Hero8(Time()).ask("/gp/gpControl/status", "").body
    keys = json.loads(body, strict=False)["status"].keys()
    assert not {"43", "44"} & keys
    assert {"4", "6", "8", "10", "13", "32", "33", "35", "54", "57", "60", "70", "82", "89", "96"} <= keys
    with pytest.raises(json.JSONDecodeError):
        json.loads(body)


def test_single_digit_dates_are_refused():
    assert Hero8(Time()).ask("/gp/gpControl/command/setup/date_time?p=%1A%1%9%B%30%2", "").code == 500


def test_the_stream_clock_drifts_and_steps_as_planned():
    plan = FaultPlan("gopro", [parse("gopro:clock_drift=50"), parse("gopro:clock_step=2.5@10")])
    clock = StreamClock(plan, Random(1), origin_ns=0)
    assert clock.at(5_000_000_000) == 5_000_250_000
    assert clock.at(10_000_000_000) == 12_500_500_000
    assert clock.at(20_000_000_000) == 22_501_000_000


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("loss=1", []),
        ("duplicate=1", [b"a", b"a", b"b", b"b", b"c", b"c"]),
        ("reorder=1", [b"b", b"a"]),
        ("delay_jitter=1", [b"a", b"b", b"c"]),
    ],
)
def test_the_bad_line_does_what_the_plan_says(fault, expected):
    line = BadLine(FaultPlan("gopro", [parse(f"gopro:{fault}")]), Random(1))
    assert [arrived for datagram in (b"a", b"b", b"c") for arrived in line.carry(datagram, 0.0)] == expected


def test_datagrams_are_seven_packets_and_the_truth_matches_the_stream(tmp_path):
    truth = tmp_path / "truth.jsonl"
    camera = emulator("gopro:clock_drift=100", truth=truth)
    host = loopback_address()
    camera.start()
    demuxer, units = Demuxer(), []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind((host, STREAM_PORT))
        ear.settimeout(PATIENCE_S)
        Camera(camera._address, camera.http_port, host).preview(start=True)
        while len(units) < 30:
            datagram = ear.recv(2048)
            assert len(datagram) == 1316
            units += demuxer.feed(datagram, 0)
    camera.stop()
    lines = [json.loads(line) for line in truth.read_text().splitlines()]
    spacing = {round(b["host_ns"] - a["host_ns"], -3) for a, b in itertools.pairwise(lines)}
    assert spacing == {100_100_000}
    assert {line["sensor_ns"] * 9 // 100_000 for line in lines} & {unit.pts for unit in units}
    steps = {b.pts - a.pts for a, b in itertools.pairwise(units)}
    assert steps <= {3003, 3004}


def test_a_taken_port_is_said():
    first = emulator()
    first.start()
    second = emulator(address=first._address)
    with pytest.raises(SimulationError, match="cannot open its ports"):
        second.start()
    wait_for(first.reachable)
    first.stop()


@pytest.mark.skipif(not CLIP.exists(), reason="the real clip ../shared/data/gopro is not here")
def test_a_clip_plays_over_and_over():
    clip = ClipSource(CLIP)
    assert len(clip) == 315
    assert clip.access_unit(0)[1]
    assert clip.access_unit(315) == clip.access_unit(0)
    decoder = av.CodecContext.create("h264", "r")
    pictures = [picture for k in range(20) for picture in decoder.decode(av.Packet(clip.access_unit(k)[0]))]
    assert (pictures[0].width, pictures[0].height) == (848, 480)


def test_a_file_that_is_no_video_is_said(tmp_path):
    (tmp_path / "clip.mp4").write_bytes(b"no video")
    with pytest.raises(SimulationError, match="cannot be read"):
        ClipSource(tmp_path / "clip.mp4")


def test_quirks_default_to_a_hero8():
    assert b"HERO8 Black" in Hero8(Time(), Quirks()).ask("/gp/gpControl", "").body
