"""The emulated device against what was measured on hardware."""

import json
import struct
from pathlib import Path

import pytest

from drivers.livox import commands
from drivers.livox.frames import Command, Frame, Kind, Sender, decode, encode
from drivers.livox.keys import Key
from drivers.livox.status import WorkState
from drivers.sim.livox_device import DeviceOptions, LivoxDevice
from drivers.sim.livox_oscillator import Oscillator

S = 10**9
FRAMES = Path(__file__).parents[3] / "../shared/reference/livox-frames.json"


def device(**options) -> LivoxDevice:
    made = LivoxDevice(DeviceOptions(**options), "127.0.1.10", 5000 * S)
    made.machine.advance(5000 * S)
    return made


def ask(target: LivoxDevice, command: int, data: bytes, now_ns: int = 5000 * S) -> bytes:
    answer = target.answer(Frame(command, 77, Kind.REQUEST, Sender.HOST, data), now_ns)
    assert answer is not None
    frame = decode(answer)
    assert (frame.command, frame.sequence, frame.kind, frame.sender) == (command, 77, Kind.ACK, Sender.LIDAR)
    return frame.data


def write(target: LivoxDevice, key: int, raw: bytes) -> tuple[int, int]:
    data = struct.pack("<HHHH", 1, 0, key, len(raw)) + raw
    return struct.unpack("<BH", ask(target, Command.WRITE, data))


def test_push_has_the_thirty_keys_in_401_bytes():
    frame = decode(device().push(5000 * S))
    assert len(frame.data) == 401
    assert len(encode(frame)) == 425
    keys = list(commands.decode_values(frame.data))
    settings = [0x0000, 0x0001, 0x0004, 0x0005, 0x0006, 0x0007, 0x0012, *range(0x0015, 0x001B), 0x001C]
    assert keys == [*settings, *range(0x8000, 0x800D), 0x800E, 0x8010, 0x8011]
    assert (frame.kind, frame.sender) == (Kind.REQUEST, Sender.LIDAR)


@pytest.mark.parametrize(
    ("key", "raw", "code"),
    [
        (Key.POINT_TYPE, b"\x02", 0x00),
        (Key.POINT_TYPE, b"\x04", 0x03),
        (Key.PATTERN, b"\x01", 0x03),
        (Key.POINT_TYPE, b"\x01\x00", 0x23),
        (Key.SERIAL, bytes(16), 0x22),
        (Key.NETWORK, bytes(12), 0x21),
        (0x002B, bytes(3), 0x20),
        (0x0026, b"\x01", 0x20),
        (0x0009, bytes(8), 0x20),
    ],
)
def test_writes_are_answered_as_by_the_hardware(key, raw, code):
    refused = code not in (0x00, 0x21)
    assert write(device(), key, raw) == (code, key if refused else 0)


def test_write_with_a_wrong_count():
    assert ask(device(), Command.WRITE, struct.pack("<HHHHB", 2, 0, 0, 1, 1)) == b"\x24\0\0"


def test_read_of_known_and_unknown_keys_is_refused_and_answered_all_the_same():
    reply = commands.decode_read_reply(ask(device(), Command.READ, commands.encode_keys((0x8006, 0x0026, 0x8010))))
    assert reply == commands.ReadReply(0x20, {0x8006: 1, 0x8010: 1})
    assert ask(device(), Command.READ, commands.encode_keys((0x002B,))) == b"\x20\0\0"


def test_worked_requests_are_obeyed():
    if not FRAMES.exists():
        pytest.skip("the worked frames are not beside the repository")
    frames = {name: bytes.fromhex(text) for name, text in json.loads(FRAMES.read_text()).items()}
    target = device()
    for request, answer in (("cfg_hosts_req_seq2", "cfg_ack_ok_seq2"), ("gps_time_req_seq8", "gps_time_ack_seq8")):
        assert target.answer(decode(frames[request]), 5000 * S) == frames[answer]
    assert target.setting(Key.POINT_HOST).address == "192.168.1.50"
    assert target.answer(decode(frames["cfg_ack_ok_seq2"]), 5000 * S) is None


def states(target: LivoxDevice, start_ns: int, seconds: float) -> list[tuple[float, WorkState]]:
    """Changes of state, in seconds after `start_ns`."""
    changes: list[tuple[float, WorkState]] = []
    for step in range(int(seconds * 100)):
        target.machine.advance(start_ns + step * S // 100)
        if not changes or changes[-1][1] is not target.machine.state:
            changes.append((step / 100, target.machine.state))
    return changes


def test_power_up_as_measured():
    target = LivoxDevice(DeviceOptions(uptime_s=0.0), "127.0.1.10", 0)
    changes = states(target, 0, 12)
    assert [state for _, state in changes] == [
        WorkState.SELFCHECK,
        WorkState.MOTOR_STARTUP,
        WorkState.READY,
        WorkState.SAMPLING,
    ]
    assert changes[-1][0] == pytest.approx(11.02, abs=0.02)


def test_stop_and_start_as_measured():
    target, now = device(), 5000 * S
    target.machine.aim(WorkState.IDLE, now)
    changes = states(target, now, 6)
    assert [state for _, state in changes] == [WorkState.READY, WorkState.IDLE]
    now += 6 * S
    target.machine.aim(WorkState.SAMPLING, now)
    assert states(target, now, 7)[-1] == (pytest.approx(6.1, abs=0.02), WorkState.SAMPLING)
    target.machine.aim(WorkState.IDLE, now + 10 * S)
    target.machine.advance(now + 11 * S)
    target.machine.aim(WorkState.SAMPLING, now + 11 * S)
    assert states(target, now + 11 * S, 11)[-1] == (pytest.approx(10.1, abs=0.02), WorkState.SAMPLING)


def test_reboot_as_measured():
    target, now = device(), 5000 * S
    ask(target, Command.REBOOT, struct.pack("<H", 0))
    machine = target.machine
    for t_s, state, streaming, reachable in (
        (0.1, WorkState.ERROR, True, True),
        (1.2, WorkState.ERROR, True, True),
        (1.3, WorkState.ERROR, False, False),
        (8.8, WorkState.ERROR, False, False),
        (9.0, WorkState.MOTOR_STARTUP, False, True),
        (13.545, WorkState.READY, False, True),
        (13.6, WorkState.SAMPLING, True, True),
    ):
        machine.advance(now + round(t_s * S))
        assert (machine.state, machine.streaming, machine.reachable) == (state, streaming, reachable), t_s
    assert (now + 13.56 * S - machine.power_on_ns) / S == pytest.approx(11.02)
    assert target.values(now)[Key.POWER_UPS] == 18


def test_oscillator_drifts_steps_and_is_invertible():
    oscillator = Oscillator(100 * S, 50.0)
    assert oscillator.ticks_ns(1100 * S) == 1000 * S + 50_000_000
    oscillator.drift(150.0, 1100 * S)
    assert oscillator.ticks_ns(2100 * S) == 2000 * S + 250_000_000
    assert oscillator.host_ns(oscillator.ticks_ns(1700 * S)) == pytest.approx(1700 * S, abs=2)
    oscillator.step(-5 * S)
    assert oscillator.stamp_ns(20 * S) == 15 * S
    oscillator.restart(3000 * S)
    assert oscillator.stamp_ns(oscillator.ticks_ns(3001 * S)) == pytest.approx(S, abs=1_000_000)
