"""Whatever bytes come, the parsers answer with a value or with ProtocolError; what they encode they decode."""

import contextlib
import ipaddress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.errors import ProtocolError
from drivers.livox import commands, packets
from drivers.livox.frames import Frame, Kind, Sender, decode, encode
from drivers.livox.hms import explain, worst
from drivers.livox.keys import PARAMETERS, Endpoint, Key, Network, decode_value, encode_value
from drivers.livox.receive import SLOT_BYTES, Block
from drivers.livox.status import read_identity, read_status, state_text
from drivers.livox.stream import StreamDecoder

PARSERS = [
    decode,
    packets.decode,
    commands.decode_discovered,
    commands.decode_values,
    commands.decode_keys,
    commands.decode_read_reply,
    commands.decode_write_reply,
]
addresses = st.integers(0, 2**32 - 1).map(lambda number: str(ipaddress.IPv4Address(number)))
ports = st.integers(0, 65535)
frames = st.builds(
    Frame,
    command=ports,
    sequence=st.integers(0, 2**32 - 1),
    kind=st.sampled_from(Kind),
    sender=st.sampled_from(Sender),
    data=st.binary(max_size=1376),
)


@given(data=st.binary(max_size=1500))
def test_parsers_raise_nothing_but_protocol_errors(data):
    for parse in PARSERS:
        with contextlib.suppress(ProtocolError):
            parse(data)


@given(frame=frames)
def test_frames_come_back(frame):
    assert decode(encode(frame)) == frame


@given(frame=frames, bit=st.integers(0, 24 * 8 - 1))
def test_a_flipped_bit_in_the_header_is_noticed(frame, bit):
    damaged = bytearray(encode(frame))
    damaged[bit // 8] ^= 1 << bit % 8
    with pytest.raises(ProtocolError):
        decode(damaged)


@given(raw=st.dictionaries(st.sampled_from(sorted(PARAMETERS)), st.binary(min_size=64, max_size=64)))
def test_status_lists_come_back_and_are_understood(raw):
    """Numbers and addresses are rebuilt byte for byte; a text is cut at its NUL."""
    values = {key: decode_value(key, data[: PARAMETERS[key].length]) for key, data in raw.items()}
    values.pop(Key.ATTITUDE, None)  # NaN is not equal to itself
    assert commands.decode_values(commands.encode_values(values)) == values
    status, identity = read_status(values), read_identity(values)
    worst(status.hms)
    assert state_text(status.work_state)
    assert identity.firmware.count(".") == 2


@given(address=addresses, mask=addresses, gateway=addresses, port=ports, source=ports)
def test_addresses_come_back(address, mask, gateway, port, source):
    for key, value in (
        (Key.POINT_HOST, Endpoint(address, port, source)),
        (Key.NETWORK, Network(address, mask, gateway)),
    ):
        assert decode_value(key, encode_value(key, value)) == value


@pytest.mark.parametrize(
    ("key", "value"),
    [(Key.POINT_TYPE, 300), (Key.POINT_HOST, "nowhere"), (0x002B, 1), (Key.IO, (1, 2)), (Key.SERIAL, 3)],
)
def test_values_that_do_not_fit_are_refused_by_name(key, value):
    with pytest.raises(ProtocolError):
        encode_value(key, value)


@settings(max_examples=60)
@given(
    datagrams=st.lists(
        st.tuples(st.binary(max_size=200), st.sampled_from((0, 1, 2, 3, 17)), st.integers(0, 2**64 - 1), st.booleans()),
        max_size=20,
    )
)
def test_any_datagrams_are_decoded_or_counted(datagrams):
    """Random bytes, and headers made to fit them with random times and counts."""
    block = Block()
    for number, (data, data_type, time_ns, fit) in enumerate(datagrams):
        raw = bytearray(data)
        if fit and data_type in packets.RECORDS:
            size = packets.RECORDS[data_type].itemsize
            dots = 1 + len(data) // size
            raw = bytearray(36 + dots * size)
            head = packets.headers(np.frombuffer(raw, np.uint8).reshape(1, -1))
            head["length"], head["dot_num"], head["data_type"] = len(raw), dots, data_type
            head["udp_cnt"], head["timestamp"] = time_ns % 65536, time_ns % 2**63
        block.slots[number, : len(raw)] = np.frombuffer(raw, np.uint8)
        block.lengths.append(len(raw))
        block.receive_ns.append(10**12 + number * 1000)
    messages = []
    decoder = StreamDecoder(messages.append, lambda *_: None, lambda *_: None)
    decoder.decode(block)
    decoder.flush()
    taken = sum(c.received + c.duplicates + c.odd for c in (decoder.points, decoder.imu))
    assert decoder.malformed + taken <= len(datagrams) <= SLOT_BYTES


def test_health_codes_have_words_and_gps_is_never_a_fault():
    assert not explain(0x04070002).fault
    assert worst([0x04070002]) is None
    finding = worst([0x04070002, 0x01040002, 0x01160003])
    assert finding is not None
    assert "supply voltage" in finding.text
    assert "battery" in finding.advice
    assert worst([0x77770004]).advice
