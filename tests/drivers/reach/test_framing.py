import re
from functools import reduce

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drivers.reach.framing import MAX_BYTES, Framer, Rejection
from tests.drivers.reach import nmea_oracle

GGA = nmea_oracle.sentence("GNGGA,231938.60,5330.0158984,N,00216.5258340,W,1,06,6.5,52.140,M,51.454,M,0.0,").encode()
GST = nmea_oracle.sentence("GNGST,231938.60,11.000,,,,4.700,6.400,5.900").encode()
UBX = b"\xb5\x62\x01\x07\x04\x00abcd\x10\x20"

stream = st.lists(
    st.one_of(
        st.binary(max_size=40),
        st.sampled_from([GGA, GST, UBX, b"\r\n", b"\n", b"$", b"*", GGA[:30], GST + b"\r\n", b"$" + b"A" * 300]),
    ),
    max_size=12,
).map(b"".join)


def framed(data: bytes) -> list[str]:
    return [frame.sentence for frame in Framer().feed(data, 0)]


def test_the_checksums_of_a_real_reach_epoch_are_good():
    assert GGA.endswith(b"*78")
    assert GST.endswith(b"*5E")
    assert framed(GGA + b"\r\n" + GST + b"\r\n") == [GGA.decode(), GST.decode()]


def test_a_sentence_starts_in_mid_line_after_binary():
    assert framed(UBX + GGA + b"\r\n" + UBX + GST + b"\n") == [GGA.decode(), GST.decode()]


def test_a_dollar_inside_starts_anew():
    framer = Framer()
    assert [f.sentence for f in framer.feed(GGA[:40] + GST + b"\r\n", 0)] == [GST.decode()]
    assert framer.rejected == {Rejection.INTERRUPTED: 1}


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (GGA[:-3], Rejection.NO_CHECKSUM),
        (GGA[:-1], Rejection.NO_CHECKSUM),
        (b"$*00", Rejection.NO_CHECKSUM),
        (GGA.replace(b"5330", b"5331"), Rejection.BAD_CHECKSUM),
        (GGA[:20] + b"\x00" + GGA[20:], Rejection.NOT_TEXT),
        (b"$" + b"A" * MAX_BYTES, Rejection.TOO_LONG),
    ],
)
def test_what_is_no_sentence_is_counted_by_reason(data, reason):
    framer = Framer()
    assert framer.feed(data + b"\r\n", 0) == []
    assert framer.rejected == {reason: 1}


def test_checksum_zero_and_lower_case_digits_are_good():
    assert framed(b"$AA*00\r\n") == ["$AA*00"]
    assert framed(GST[:-2] + b"5e\r\n") == [GST[:-2].decode() + "5e"]


def test_half_a_line_before_the_first_dollar_is_dropped_quietly():
    framer = Framer()
    assert len(framer.feed(GGA[30:] + b"\r\n" + GST + b"\r\n", 0)) == 1
    assert not framer.rejected


def test_a_sentence_bears_the_time_of_its_first_byte():
    framer = Framer()
    assert framer.feed(GGA[:10], 100) == []
    first, second = framer.feed(GGA[10:] + b"\r\n" + GST + b"\r\n", 200)
    assert (first.receive_ns, second.receive_ns) == (100, 200)


def test_a_sentence_begun_before_a_reopening_is_forgotten():
    framer = Framer()
    framer.feed(GGA[:40], 0)
    framer.reset()
    assert framer.feed(GGA[40:] + b"\r\n", 0) == []


@given(stream)
@example(b"$\xff$GN\r\n")
def test_any_bytes_give_valid_sentences_only(data):
    for sentence in framed(data):
        match = re.fullmatch(r"\$([ -#%-)+-~]+)\*([0-9A-Fa-f]{2})", sentence)
        assert match
        assert reduce(lambda x, y: x ^ y, match[1].encode()) == int(match[2], 16)
        assert sentence.encode() in data
    assert framed(data) == nmea_oracle.valid_sentences(data)


@given(stream, st.lists(st.integers(1, 60), min_size=1, max_size=20))
def test_the_cut_into_chunks_changes_nothing(data, sizes):
    whole, cut = Framer(), Framer()
    expected = [f.sentence for f in whole.feed(data, 0)]
    found, at, k = [], 0, 0
    while at < len(data):
        size = sizes[k % len(sizes)]
        found += [f.sentence for f in cut.feed(data[at : at + size], 0)]
        at, k = at + size, k + 1
    assert found == expected
    assert cut.rejected == whole.rejected
    assert cut.noise_bytes == whole.noise_bytes
