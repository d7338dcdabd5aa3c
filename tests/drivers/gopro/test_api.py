"""The HTTP commands, against the emulated camera and against servers that are no camera."""

import socketserver
import threading
from contextlib import contextmanager, suppress
from datetime import datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import DriverError, ProtocolError, SensorRefused, SensorUnreachable, SensorUnsupported
from drivers.gopro.api import Camera, clock_text
from drivers.sim.gopro_device import Quirks
from tests.drivers.gopro.rig import emulator, loopback_address


@pytest.fixture
def emulated():
    camera = emulator(quirks=Quirks(preview_survives_shutter=True))
    camera.start()
    yield camera
    camera.stop()


@contextmanager
def server(answer: bytes | None):
    """Sends these bytes to whoever connects; None: says nothing and keeps the line open."""
    release = threading.Event()

    class Handler(socketserver.BaseRequestHandler):
        def handle(self):
            self.request.recv(4096)
            if answer is None:
                release.wait()
            else:
                self.request.sendall(answer)

    with socketserver.ThreadingTCPServer((loopback_address(), 0), Handler) as listening:
        thread = threading.Thread(target=listening.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield Camera(*listening.server_address, timeout_s=0.3)
        finally:
            release.set()
            listening.shutdown()
            thread.join()


def http(body: bytes, code: int = 200) -> bytes:
    return b"HTTP/1.1 %d X\r\nContent-Length: %d\r\n\r\n%s" % (code, len(body), body)


def test_two_digits_of_hex_for_each_part_of_the_date():
    assert clock_text(datetime(2026, 1, 9, 11, 48, 2)) == "%1A%01%09%0B%30%02"


def test_the_whole_conversation(emulated):
    camera = Camera(emulated._address, emulated.http_port, loopback_address())
    assert camera.identify().serial.endswith("123")
    camera.set_clock(datetime(2026, 1, 9, 11, 48, 2))
    assert emulated.device.date.replace(microsecond=0, second=0) == datetime(2026, 1, 9, 11, 48)
    camera.set_setting("59", 0)
    assert camera.status()["settings"]["59"] == 0
    camera.preview(start=True)
    assert emulated.device.stream_to is not None
    camera.preview(start=False)
    assert emulated.device.stream_to is None


def test_the_stream_goes_to_the_one_who_asked(emulated):
    own = loopback_address()
    Camera(emulated._address, emulated.http_port, own).preview(start=True)
    assert emulated.device.stream_to == own


def test_webcam_success_is_status_two_with_error_zero(emulated):
    camera = Camera(emulated._address, emulated.http_port)
    assert not camera.webcam_status().streaming
    assert camera.webcam_start(720, 8554).streaming
    with pytest.raises(SensorRefused):
        camera.shutter(on=True)
    assert camera.webcam_settings("linear").streaming
    assert camera.webcam_stop().status == 1
    assert camera.webcam_exit().status == 0
    with pytest.raises(ProtocolError, match="gpWebcam/status"):
        camera._webcam("status")


def test_the_old_stream_command_is_refused_with_the_cameras_words(emulated):
    camera = Camera(emulated._address, emulated.http_port)
    with pytest.raises(SensorRefused, match="HTTP 500: error -3"):
        camera._ask("/gp/gpControl/execute?p1=gpStream&a1=proto_v2&c1=restart")
    with pytest.raises(SensorRefused, match="404"):
        camera._ask("/gopro/camera/state")


def test_line_breaks_inside_strings_are_the_cameras_way():
    with server(http(b'{"info":{"model_name":"HERO8\nBlack","firmware_version":"HD8.01.02.51.00"}}')) as camera:
        assert camera.identify().firmware == "HD8.01.02.51.00"


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (None, SensorUnreachable),
        (b"", SensorUnreachable),
        (b"\x00\xff garbage\r\n\r\n", ProtocolError),
        (http(b"no json"), ProtocolError),
        (http(b"[1]"), ProtocolError),
        (http(b"[" * 100_000), ProtocolError),
        (http(b"", 500), SensorRefused),
        (http(b"{}"), SensorUnsupported),
        (http(b'{"info":{"model_name":"HERO9 Black"}}'), SensorUnsupported),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 50\r\n\r\n{", DriverError),
    ],
)
def test_every_bad_answer_is_one_of_our_errors(answer, error):
    with server(answer) as camera, pytest.raises(error):
        camera.identify()


def test_nobody_there_is_unreachable():
    with pytest.raises(SensorUnreachable, match="does not answer"):
        Camera(loopback_address(), 9, timeout_s=0.3).identify()


@given(body=st.binary(max_size=200))
def test_any_body_parses_or_is_a_protocol_error(body):
    with suppress(ProtocolError):
        assert isinstance(Camera("127.0.0.1")._parse("/", body), dict)
