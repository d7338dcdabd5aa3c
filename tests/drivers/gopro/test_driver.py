"""The driver against the emulated camera, end to end over loopback."""

import socket
import threading
from contextlib import contextmanager

import pytest

from drivers.driver import SensorState
from drivers.sim.gopro_device import Quirks
from tests.drivers.gopro.rig import STREAM_PORT, Running, config, emulator, loopback_address
from tests.drivers.sources import tiny_units
from tests.waiting import wait_for


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    """A camera that is busy for a moment only, and a driver that looks again soon."""
    monkeypatch.setattr("drivers.sim.gopro_device.BUSY_S", 0.05)
    monkeypatch.setattr("drivers.gopro.patience.POLL_S", 0.1)
    monkeypatch.setattr("drivers.gopro.streams.POLL_S", 0.1)


@contextmanager
def camera(*faults, **options):
    emulated = emulator(*faults, **options)
    emulated.start()
    try:
        yield emulated
    finally:
        emulated.stop()


def of(emulated, **changes):
    return config(emulated._address, emulated.http_port, **changes)


def consecutive(frames):
    """Whether the frames are the source's, in order, none missing."""
    units = tiny_units()
    first = units.index(frames[0].data)
    return all(frame.data == units[(first + k) % len(units)] for k, frame in enumerate(frames))


def test_wifi_streams_every_access_unit_byte_for_byte_from_a_keyframe_on():
    with camera() as emulated, Running(of(emulated)) as driver:
        wait_for(lambda: len(driver.frames) > 40)
        frames = list(driver.frames)
        assert frames[0].keyframe
        assert consecutive(frames)
        ways_ns = [frame.receive_ns - round(frame.pts_90khz / 90e3 * 1e9) for frame in frames]
        late_ns = max(ways_ns) - min(ways_ns)  # little, and whatever a busy machine adds
        assert all(0 <= frame.receive_ns - frame.stamp_ns + late_ns < 200_000_000 + 2 * late_ns for frame in frames)
        wait_for(lambda: driver.sensor.health().state is not SensorState.STARTING)
        health = driver.sensor.health()
        assert health.battery_percent is not None
        assert health.details["firmware"] == "HD8.01.02.51.00"
        assert health.streams[0].lost == 0
        assert health.clock is not None


def test_the_camera_is_set_up_as_configured_and_left_in_a_sane_state():
    with camera() as emulated:
        with Running(of(emulated)) as driver:
            wait_for(lambda: driver.frames)
            assert {"59": 0, "83": 1, "135": 0}.items() <= emulated.device.settings.items()
            assert emulated.device.date.year >= 2024
            driver.sensor.session_started()
            wait_for(lambda: emulated.device.recording)
        assert not emulated.device.recording
        assert emulated.device.stream_to is None
        assert not [thread for thread in threading.enumerate() if thread.name == "gopro-stream"]


def test_the_session_starts_and_stops_the_recording_and_the_preview_goes_on():
    with camera() as emulated, Running(of(emulated)) as driver:
        wait_for(lambda: driver.frames)
        driver.sensor.session_started()
        wait_for(lambda: driver.told("camera recording started: shutter sent at"))
        assert emulated.device.recording
        before = len(driver.frames)
        wait_for(lambda: len(driver.frames) > before + 10)
        driver.sensor.session_stopped()
        wait_for(lambda: driver.told("camera recording stopped"))
        assert not emulated.device.recording
        before = len(driver.frames)
        wait_for(lambda: len(driver.frames) > before + 10)
        assert emulated.device.requests.count("/gp/gpControl/execute?p1=gpStream&c1=restart") == 3


def test_usb_streams_without_recording_and_leaves_webcam_mode():
    with camera(quirks=Quirks(webcam_starts=1)) as emulated:
        with Running(of(emulated, mode="usb")) as driver:
            driver.sensor.session_started()
            wait_for(lambda: len(driver.frames) > 20)
            assert consecutive(list(driver.frames))
            assert emulated.device.webcam == 2
            assert not emulated.device.recording
        assert emulated.device.webcam == 0
        asked = list(emulated.device.requests)
        assert asked.index("/gp/gpWebcam/STOP") < asked.index(f"/gp/gpWebcam/START?res=12&port={STREAM_PORT}")


def test_usb_asks_again_when_the_first_start_does_nothing(monkeypatch):
    monkeypatch.setattr("drivers.gopro.streams.WEBCAM_WAITS_S", (0.4, 0.4))
    with camera(quirks=Quirks(webcam_starts=2)) as emulated, Running(of(emulated, mode="usb")) as driver:
        wait_for(lambda: len(driver.frames) > 5)


def test_kept_alive_the_picture_never_freezes(monkeypatch):
    monkeypatch.setattr("drivers.gopro.keepalive.INTERVAL_S", 0.05)
    with camera(quirks=Quirks(frozen_after_s=1.0)) as emulated, Running(of(emulated)) as driver:
        wait_for(lambda: len(driver.frames) > 45)
        assert consecutive(list(driver.frames))


def test_a_silent_stream_is_started_again_and_then_the_operator_is_told_where_to_look():
    with camera() as emulated, Running(of(emulated, stall_s=0.6)) as driver:
        wait_for(lambda: driver.frames)
        emulated._plan.begin("gopro:stall")
        wait_for(lambda: driver.told("camera stream is silent"))
        wait_for(lambda: f"nothing arrives on UDP port {STREAM_PORT}" in driver.sensor.health().problem)
        health = driver.sensor.health()
        assert health.state is SensorState.FAILED
        assert "firewall" in health.advice


def test_the_camera_goes_away_and_comes_back():
    with camera() as emulated, Running(of(emulated, stall_s=0.6)) as driver:
        wait_for(lambda: driver.frames)
        emulated._plan.begin("gopro:disconnect")
        wait_for(lambda: driver.told("camera lost"))
        wait_for(lambda: driver.sensor.health().state is SensorState.SEARCHING)
        emulated._plan.end()
        wait_for(lambda: len([e for e in driver.events if "camera found" in e.text]) == 2)
        before = len(driver.frames)
        wait_for(lambda: len(driver.frames) > before + 10)


def test_a_reboot_begins_a_new_clock_and_the_recording_starts_again(monkeypatch):
    monkeypatch.setattr("drivers.sim.gopro_device.BOOT_S", 0.8)
    monkeypatch.setattr("drivers.sim.gopro_device.READY_S", 0.2)
    with camera() as emulated, Running(of(emulated, stall_s=0.6)) as driver:
        driver.sensor.session_started()
        wait_for(lambda: emulated.device.recording and driver.frames)
        emulated._plan.begin("gopro:reboot")
        wait_for(lambda: driver.told("stream clock began anew"))
        wait_for(lambda: len([e for e in driver.events if "recording started" in e.text]) == 2)
        clock = driver.sensor.health().clock
        assert clock is not None
        assert clock.steps == 1


def test_a_camera_that_stays_busy_is_bounded_and_reported(monkeypatch):
    monkeypatch.setattr("drivers.gopro.link.READY_S", 0.6)
    monkeypatch.setattr("drivers.gopro.patience.WAIT_S", 0.5)
    settings = {"set_clock": False, "settings": {}}
    with camera(quirks=Quirks(always_busy=True)) as emulated, Running(of(emulated, **settings)) as driver:
        wait_for(lambda: driver.sensor.health().state is SensorState.FAILED)
        assert "refused with HTTP 500" in driver.sensor.health().problem
        assert "error -3" in driver.sensor.health().problem


def test_a_camera_that_will_not_record_streams_on_and_says_so():
    with camera(quirks=Quirks(refuses_recording=True)) as emulated, Running(of(emulated)) as driver:
        driver.sensor.session_started()
        wait_for(lambda: driver.told("camera does not start recording"))
        wait_for(lambda: "does not start recording" in driver.sensor.health().problem)
        before = len(driver.frames)
        wait_for(lambda: len(driver.frames) > before + 10)


def test_another_model_is_refused_in_words():
    with camera(quirks=Quirks(model_name="HERO7 Black")) as emulated, Running(of(emulated)) as driver:
        wait_for(lambda: driver.sensor.health().state is SensorState.FAILED)
        assert "HERO7 Black" in driver.sensor.health().problem


def test_nobody_there_is_searching_and_stops_at_once():
    with Running(config(loopback_address(), 1)) as driver:
        wait_for(lambda: driver.sensor.health().problem)
        assert driver.sensor.health().state is SensorState.SEARCHING
        assert driver.sensor.health().advice


def test_a_taken_stream_port_is_said_and_taken_over_once_free():
    with camera() as emulated:
        wanted = of(emulated)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as player:
            player.bind((wanted.host, STREAM_PORT))
            driver = Running(wanted).__enter__()
            wait_for(lambda: f"UDP port {STREAM_PORT}" in driver.sensor.health().problem)
            assert driver.sensor.health().state is SensorState.FAILED
        with driver:
            wait_for(lambda: driver.frames)


def test_a_dead_stream_thread_turns_red_and_is_started_again(monkeypatch):
    with camera() as emulated, Running(of(emulated)) as driver:
        wait_for(lambda: driver.frames)
        with monkeypatch.context() as broken:
            broken.setattr("drivers.gopro.h264.kind", lambda data: 1 / 0)
            wait_for(lambda: "ZeroDivisionError" in driver.sensor.health().problem)
        before = len(driver.frames)
        wait_for(lambda: len(driver.frames) > before + 5)


def test_copies_swaps_and_rubbish_cost_nothing():
    with camera() as emulated, Running(of(emulated)) as driver:
        for fault in ("gopro:duplicate=0.3", "gopro:reorder=0.2", "gopro:garbage=40"):
            before = len(driver.frames)
            emulated._plan.begin(fault)
            wait_for(lambda before=before: len(driver.frames) > before + 20)
            emulated._plan.end()
        assert consecutive(list(driver.frames))
        assert driver.sensor.health().streams[0].lost == 0


def test_lost_datagrams_cost_only_their_frames_and_are_counted():
    with camera("gopro:loss=0.05") as emulated, Running(of(emulated)) as driver:
        wait_for(lambda: driver.sensor.health().streams[0].lost > 0)
        whole = set(tiny_units())
        assert all(frame.data in whole for frame in list(driver.frames))
        assert int(driver.sensor.health().details["lost packets"]) > 0
