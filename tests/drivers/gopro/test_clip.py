"""Real video over real sockets: every access unit comes out of the driver as it went into the stream."""

import http.server
import socket
import threading

from drivers.sim.clip import ClipSource
from drivers.sim.gopro_device import Hero8
from tests.drivers.gopro.rig import STREAM_PORT, Running, config, emulator, loopback_address
from tests.drivers.gopro.test_transport_stream import CLIP, ffmpeg_packets, needs_clip, remuxed_clip
from tests.waiting import wait_for

BURST = 40
"""Datagrams between two breaths of the sender: the receiver's buffer holds hundreds."""


class FfmpegCamera:
    """Answers like a HERO8, and sends one transport stream that FFmpeg wrote, once it is asked for."""

    def __init__(self, stream: bytes):
        self.address, self.stream, device = loopback_address(), stream, Hero8(lambda: 1000.0)
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.bind((self.address, STREAM_PORT))
        self.sender = None
        camera = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                reply = device.ask(self.path, self.client_address[0])
                self.send_response(reply.code)
                self.send_header("Content-Length", str(len(reply.body)))
                self.end_headers()
                self.wfile.write(reply.body)
                if device.stream_to and camera.sender is None:
                    camera.sender = threading.Thread(target=camera.send, args=(device.stream_to,))
                    camera.sender.start()

            def log_message(self, *args):
                """Quiet."""

        self.server = http.server.ThreadingHTTPServer((self.address, 0), Handler)
        self.serving = threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.02})

    def __enter__(self):
        self.serving.start()
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.serving.join()
        self.sender.join()
        self.server.server_close()
        self.udp.close()

    def send(self, host):
        breath = threading.Event()
        for number, at in enumerate(range(0, len(self.stream), 1316)):
            self.udp.sendto(self.stream[at : at + 1316], (host, STREAM_PORT))
            if number % BURST == 0:
                breath.wait(0.01)


@needs_clip
def test_the_real_clip_remuxed_by_ffmpeg_arrives_byte_for_byte():
    stream = remuxed_clip()
    expected = ffmpeg_packets(stream)
    quiet = {"set_clock": False, "settings": {}, "record_on_camera": False}
    with FfmpegCamera(stream) as camera, Running(config(camera.address, camera.server.server_port, **quiet)) as driver:
        wait_for(lambda: len(driver.frames) == len(expected))
        assert [(frame.data, frame.pts_90khz) for frame in driver.frames] == expected
        assert len(expected) == 315
        health = driver.sensor.health()
        assert health.streams[0].lost == 0
        assert health.details["lost packets"] == "0"


@needs_clip
def test_the_real_clip_through_the_emulator_arrives_byte_for_byte():
    clip = ClipSource(CLIP)
    emulated = emulator(source=clip)
    emulated.start()
    try:
        with Running(config(emulated._address, emulated.http_port)) as driver:
            wait_for(lambda: len(driver.frames) > 45)
            units = [clip.access_unit(k)[0] for k in range(len(clip))]
            first = units.index(driver.frames[0].data)
            received = [frame.data for frame in list(driver.frames)]
            assert received == [units[(first + k) % len(units)] for k in range(len(received))]
            assert driver.frames[0].keyframe
    finally:
        emulated.stop()
