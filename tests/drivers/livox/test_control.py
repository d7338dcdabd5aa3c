"""Requests against a scripted device: lost, damaged, foreign and refusing answers."""

import itertools
import socket
import threading
from collections.abc import Callable

import pytest

from drivers.errors import SensorRefused, SensorUnreachable
from drivers.livox.commands import ReadReply, WriteReply, encode_read_reply, encode_write_reply
from drivers.livox.control import ControlLink
from drivers.livox.frames import Frame, Kind, Sender, decode, encode
from drivers.livox.keys import Key
from tests.drivers.livox.rig import addresses

Script = Callable[[Frame, int], list[bytes]]


@pytest.fixture
def link_to():
    """A link to a device that answers request number n as `script(frame, n)` says."""
    opened, ended = [], threading.Event()

    def make(script: Script, attempts: int = 50) -> ControlLink:
        lidar, host = addresses()
        device = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        device.bind((lidar, 56100))

        def serve() -> None:
            for number in itertools.count():
                datagram, sender = device.recvfrom(1400)
                if ended.is_set():
                    return
                for answer in script(decode(datagram), number):
                    device.sendto(answer, sender)

        thread = threading.Thread(target=serve)
        thread.start()
        link = ControlLink((host, 56101), (lidar, 56100), timeout_s=0.1, attempts=attempts)
        opened.append((link, device, thread, lidar))
        return link

    yield make
    ended.set()
    for link, device, thread, lidar in opened:
        link.__exit__(None, None, None)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as waker:
            waker.sendto(b"", (lidar, 56100))
        thread.join()
        device.close()


def ack(frame: Frame, data: bytes, sequence: int | None = None) -> bytes:
    number = frame.sequence if sequence is None else sequence
    return encode(Frame(frame.command, number, Kind.ACK, Sender.LIDAR, data))


OK = encode_write_reply(WriteReply(0, 0))


def test_lost_requests_are_repeated(link_to):
    link = link_to(lambda frame, number: [ack(frame, OK)] if number >= 2 else [])
    assert link.write({Key.IMU_ENABLE: 1}) == ""


def test_damaged_foreign_and_stale_answers_are_passed_over(link_to):
    def script(frame: Frame, number: int) -> list[bytes]:
        sound = ack(frame, OK)
        refused = encode_write_reply(WriteReply(1, 0))
        return [sound[:-1], b"garbage", bytes(24), ack(frame, refused, sequence=4711), encode(frame), sound]

    assert link_to(script).write({Key.IMU_ENABLE: 1}) == ""


def test_answer_to_an_earlier_attempt_counts(link_to):
    earlier: list[Frame] = []

    def script(frame: Frame, number: int) -> list[bytes]:
        earlier.append(frame)
        return [ack(earlier[0], OK)] if number >= 1 else []

    assert link_to(script).write({Key.IMU_ENABLE: 1}) == ""


def test_refusal_names_the_parameter(link_to):
    link = link_to(lambda frame, _: [ack(frame, encode_write_reply(WriteReply(0x03, Key.POINT_TYPE)))])
    with pytest.raises(SensorRefused, match="refused to set point type: value out of range"):
        link.write({Key.POINT_TYPE: 1})


def test_stored_until_reboot_is_a_success_with_a_note(link_to):
    link = link_to(lambda frame, _: [ack(frame, encode_write_reply(WriteReply(0x21, 0)))])
    assert "reboot" in link.write({Key.IMU_ENABLE: 1})


def test_partly_supported_read_keeps_its_values(link_to):
    link = link_to(lambda frame, _: [ack(frame, encode_read_reply(ReadReply(0x20, {Key.WORK_STATE: 1})))])
    assert link.read([Key.WORK_STATE, 0x0026]) == {Key.WORK_STATE: 1}


def test_silence_is_said_with_advice(link_to):
    link = link_to(lambda *_: [], attempts=2)
    with pytest.raises(SensorUnreachable, match=r"does not answer.*check its power"):
        link.read([Key.WORK_STATE])
