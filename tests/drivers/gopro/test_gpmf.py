import struct
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import ProtocolError
from drivers.gopro.gpmf import keys, samples
from tests.edge.onboard.cards import gyro_payloads, key, nested

REAL = Path(__file__).parents[3] / "../shared/data/gopro/max-heromode.mp4"
GYRO = frozenset({"GYRO"})


def test_keys_follow_each_other_padded_to_four_bytes():
    data = key("DVNM", "c", 1, 5, b"Hero8") + key("TSMP", "L", 4, 1, b"\0\0\1\2")
    name, total = keys(data)
    assert name.text == "Hero8"
    assert total.numbers.tolist() == [[258.0]]


def test_the_gyroscope_comes_scaled_with_its_clock():
    rate = np.array([[0.5, -1.0, 2.0], [0.1, 0.2, 0.3]])
    (payload,) = gyro_payloads(np.array([0.1, 0.2]), rate, zero_us=1000)
    (found,) = samples(payload, GYRO)
    assert found.values == pytest.approx(rate, abs=2e-4)
    assert (found.first_us, found.total) == (101_000, 2)


def test_each_axis_has_its_own_scale_where_there_are_several():
    body = key("SCAL", "l", 4, 3, struct.pack(">3i", 1, 10, 100)) + key(
        "GYRO", "s", 6, 1, struct.pack(">3h", 5, 50, 500)
    )
    (found,) = samples(nested("DEVC", nested("STRM", body)), GYRO)
    assert found.values.tolist() == [[5.0, 5.0, 5.0]]
    assert found.first_us is None


def test_a_key_that_is_longer_than_the_rest_is_refused():
    with pytest.raises(ProtocolError, match="says 400 bytes, 4 are left"):
        list(keys(struct.pack(">4sBBH", b"GYRO", ord("s"), 4, 100) + bytes(4)))


def test_a_type_that_is_no_number_is_refused():
    (one,) = keys(key("GPSU", "U", 16, 1, b"260101000000.000"))
    with pytest.raises(ProtocolError, match="no number"):
        _ = one.numbers


@given(st.binary(max_size=300))
def test_any_bytes_are_read_or_refused(data):
    try:
        samples(nested("DEVC", nested("STRM", data)), GYRO)
        list(keys(data))
    except ProtocolError:
        pass


@pytest.mark.skipif(not REAL.exists(), reason=f"a real GoPro file is not here: {REAL}")
def test_a_real_file_has_two_hundred_samples_a_second():
    with av.open(str(REAL)) as container:
        track = next(one for one in container.streams if "GoPro MET" in one.metadata.get("handler_name", ""))
        payloads = [bytes(packet) for packet in container.demux(track) if packet.size]
    found = [one for payload in payloads for one in samples(payload, GYRO)]
    totals = np.cumsum([len(one.values) for one in found])
    assert [one.total for one in found] == totals.tolist()
    assert totals[-2] / ((len(payloads) - 1) * 1.001) == pytest.approx(200.0, rel=0.05)  # the last is cut short
    assert np.abs(np.vstack([one.values for one in found])).max() < 10.0  # rad/s, by hand
