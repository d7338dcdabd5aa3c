"""Every worked frame of the reference sheet decodes to what the sheet says, and is rebuilt byte for byte."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from drivers.livox import commands, packets
from drivers.livox.crc import crc16, crc32
from drivers.livox.frames import Command, Frame, Kind, Sender, decode, encode
from drivers.livox.keys import Endpoint, Key
from drivers.sim.livox_packets import imu_packet, point_packets
from drivers.sim.sources import PointBlock

PATH = Path(__file__).parents[3] / "../shared/reference/livox-frames.json"
pytestmark = pytest.mark.skipif(
    not PATH.exists(), reason="the worked frames lie beside the repository, and are not there"
)

CONTROL = {
    "discovery_req_seq1": (Command.DISCOVER, 1, Kind.REQUEST, Sender.HOST),
    "discovery_req_seq2": (Command.DISCOVER, 2, Kind.REQUEST, Sender.HOST),
    "discovery_ack_seq1": (Command.DISCOVER, 1, Kind.ACK, Sender.LIDAR),
    "cfg_hosts_req_seq2": (Command.WRITE, 2, Kind.REQUEST, Sender.HOST),
    "cfg_ack_ok_seq2": (Command.WRITE, 2, Kind.ACK, Sender.LIDAR),
    "cfg_ack_badkey_seq9": (Command.WRITE, 9, Kind.ACK, Sender.LIDAR),
    "start_req_seq3": (Command.WRITE, 3, Kind.REQUEST, Sender.HOST),
    "workmode_sampling_seq4": (Command.WRITE, 4, Kind.REQUEST, Sender.HOST),
    "workmode_idle_seq5": (Command.WRITE, 5, Kind.REQUEST, Sender.HOST),
    "imu_enable_seq6": (Command.WRITE, 6, Kind.REQUEST, Sender.HOST),
    "inquire_req_seq7": (Command.READ, 7, Kind.REQUEST, Sender.HOST),
    "inquire_ack_seq7": (Command.READ, 7, Kind.ACK, Sender.LIDAR),
    "push_excerpt_seq6026": (Command.PUSH, 6026, Kind.REQUEST, Sender.LIDAR),
    "gps_time_req_seq8": (Command.GPS_TIME, 8, Kind.REQUEST, Sender.HOST),
    "gps_time_ack_seq8": (Command.GPS_TIME, 8, Kind.ACK, Sender.LIDAR),
    "reboot_req_seq9": (Command.REBOOT, 9, Kind.REQUEST, Sender.HOST),
}


@pytest.fixture(scope="module")
def frames() -> dict[str, bytes]:
    return {name: bytes.fromhex(text) for name, text in json.loads(PATH.read_text()).items()}


def test_the_table_above_names_every_control_frame(frames):
    assert set(frames) - set(CONTROL) == {name for name in frames if name.startswith("data_")}


def test_checksums_have_their_published_check_values():
    assert crc16(b"123456789") == 0x29B1
    assert crc32(b"123456789") == 0xCBF43926


@pytest.mark.parametrize("name", CONTROL)
def test_control_frame_decodes_and_is_rebuilt(frames, name):
    frame = decode(frames[name])
    assert (frame.command, frame.sequence, frame.kind, frame.sender) == CONTROL[name]
    assert encode(frame) == frames[name]


def test_discovery_answer(frames):
    data = decode(frames["discovery_ack_seq1"]).data
    answer = commands.decode_discovered(data)
    assert answer == commands.Discovered(0, 9, "EXAMPLE00000012", "192.168.1.112", 56100)
    assert commands.encode_discovered(answer) == data


HOST = "192.168.1.50"
VALUES = {
    "cfg_hosts_req_seq2": {
        Key.STATUS_HOST: Endpoint(HOST, 56201, 56200),
        Key.POINT_HOST: Endpoint(HOST, 56301, 56300),
        Key.IMU_HOST: Endpoint(HOST, 56401, 56400),
    },
    "start_req_seq3": {Key.POINT_TYPE: 1, Key.IMU_ENABLE: 1, Key.WORK_TARGET: 1},
    "workmode_sampling_seq4": {Key.WORK_TARGET: 1},
    "workmode_idle_seq5": {Key.WORK_TARGET: 2},
    "imu_enable_seq6": {Key.IMU_ENABLE: 1},
    "push_excerpt_seq6026": {
        Key.WORK_STATE: 1,
        Key.CORE_TEMPERATURE: 5979,
        Key.TIME_SYNC: 0,
        Key.HMS: (0x04070002, 0, 0, 0, 0, 0, 0, 0),
    },
}


@pytest.mark.parametrize("name", VALUES)
def test_parameter_list(frames, name):
    data = decode(frames[name]).data
    assert commands.decode_values(data) == VALUES[name]
    assert commands.encode_values(VALUES[name]) == data


@pytest.mark.parametrize(
    ("name", "reply"), [("cfg_ack_ok_seq2", (0, 0)), ("cfg_ack_badkey_seq9", (commands.ReturnCode.UNSUPPORTED, 0x002B))]
)
def test_write_answer(frames, name, reply):
    data = decode(frames[name]).data
    assert commands.decode_write_reply(data) == commands.WriteReply(*reply)
    assert commands.encode_write_reply(commands.WriteReply(*reply)) == data


def test_read_request_and_answer(frames):
    keys = (Key.SERIAL, Key.VERSION_APP, Key.WORK_STATE, Key.FIRMWARE_TYPE)
    assert commands.decode_keys(decode(frames["inquire_req_seq7"]).data) == keys
    assert commands.encode_keys(keys) == decode(frames["inquire_req_seq7"]).data
    data = decode(frames["inquire_ack_seq7"]).data
    reply = commands.decode_read_reply(data)
    assert reply.values == dict(zip(keys, ("EXAMPLE00000012", (13, 18, 2, 44), 1, 1), strict=True))
    assert commands.encode_read_reply(reply) == data


def test_time_and_reboot_requests(frames):
    assert struct.unpack("<BQ", decode(frames["gps_time_req_seq8"]).data) == (2, 1_767_225_600_000_000_000)
    assert decode(frames["gps_time_ack_seq8"]).data == b"\0"
    assert decode(frames["reboot_req_seq9"]).data == struct.pack("<H", 100)


def test_imu_packet(frames):
    packet = packets.decode(frames["data_imu"])
    assert (packet.data_type, packet.udp_cnt, packet.timestamp_ns) == (packets.DataType.IMU, 4000, 4_100_000_000_000)
    gyro, accel = packet.records["gyro"][0], packet.records["accel"][0]
    np.testing.assert_allclose(gyro, (-0.00740, -0.00224, -0.01729), atol=5e-6)
    np.testing.assert_allclose(accel, (0.01079, 0.00008, 0.99895), atol=1e-5)
    rebuilt = imu_packet(tuple(gyro.tolist()), tuple(accel.tolist()), packet.timestamp_ns, packet.udp_cnt)
    assert rebuilt == frames["data_imu"]


@pytest.mark.parametrize(
    "name", ["data_pcl1_2pts_crc0", "data_pcl1_2pts_crc", "data_pcl2_2pts_crc0", "data_pcl3_2pts_crc0"]
)
def test_point_packet(frames, name):
    packet = packets.decode(frames[name])
    assert packet.data_type == int(name[8])
    assert packet.udp_cnt in (3509, 3510, 3511)
    assert abs(packet.timestamp_ns - 4_100_000_000_000) < 2_000_000
    exact = {1: 1e-6, 2: 1e-6, 3: 2e-3}[packet.data_type]
    np.testing.assert_allclose(packets.xyz_m(packet.records, packet.data_type)[0], (1.0, -2.0, 0.3), atol=exact)
    assert packet.records["reflectivity"].tolist() == [17, 0]
    assert packets.returned(packet.records, packet.data_type).tolist() == [True, False]
    assert packet.time_interval == 50  # 5 us from the first of two points to the second


def test_damaged_point_packet_is_refused_when_it_carries_a_checksum(frames):
    damaged = bytearray(frames["data_pcl1_2pts_crc"])
    damaged[40] ^= 1
    with pytest.raises(packets.ProtocolError, match="checksum"):
        packets.decode(damaged)


def test_emulated_point_packets_match_the_genuine_header():
    """The one genuine datagram in public: version 0, length 1380, interval 4750, 96 points, count 3509, type 1."""
    block = PointBlock(np.full((96, 3), 7, np.int32), np.full(96, 4, np.uint8), np.zeros(96, np.uint8))
    packet = point_packets(block, 1, np.array([4102225727730]), 3509)[0].tobytes()
    assert packet[:12] == bytes.fromhex("0064058e126000b50d000100")
    assert packet[12:28] == bytes(16)
    assert packet[28:36] == bytes.fromhex("f210b51fbb030000")
    assert len(packet) == 1380


def test_frame_longer_than_the_protocol_allows_is_refused():
    with pytest.raises(packets.ProtocolError, match="at most"):
        encode(Frame(Command.WRITE, 1, Kind.REQUEST, Sender.HOST, bytes(1400)))
