"""Lines of the control socket, whole and in pieces."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.control.codec import LineSplitter, decode, decode_envelope, decode_request, encode
from edge.control.messages import PROTOCOL_VERSION, Reply, Request
from edge.errors import ControlError


@given(text=st.text(st.characters(exclude_categories=["Cs"])), number=st.integers(0, 2**63 - 1))
def test_any_text_travels_in_one_line(text: str, number: int) -> None:
    request = Request("mark", id=number, text=text)
    line = encode(request)
    assert line.count(b"\n") == 1
    assert decode(line) == decode_request(line) == request
    assert decode(encode(Reply(number, ok=False, error=text))) == Reply(number, ok=False, error=text)


@given(st.lists(st.binary(max_size=20).map(lambda line: line.replace(b"\n", b"")), max_size=8), st.integers(1, 9))
def test_lines_come_whole_however_the_bytes_are_cut(lines: list[bytes], piece: int) -> None:
    stream = b"".join(line + b"\n" for line in lines)
    splitter = LineSplitter(100)
    got = [line for start in range(0, len(stream), piece) for line in splitter.feed(stream[start : start + piece])]
    assert got == lines


def test_a_line_past_the_limit_is_refused_even_without_its_end() -> None:
    with pytest.raises(ControlError, match="100 bytes"):
        LineSplitter(100).feed(b"x" * 100)


@given(st.binary(max_size=200))
def test_garbage_is_an_error_of_ours(data: bytes) -> None:
    with pytest.raises(ControlError):
        decode(data)
    with pytest.raises(ControlError):
        decode_request(data)
    decode_envelope(data)


def test_the_version_is_always_said_and_need_not_be() -> None:
    assert f'"version":{PROTOCOL_VERSION}'.encode() in encode(Request("hello"))
    assert f'"version":{PROTOCOL_VERSION}'.encode() in encode(Reply(1, ok=True))
    assert decode_envelope(b'{"type":"request","command":"start"}').version == PROTOCOL_VERSION


def test_deep_nesting_is_garbage_too() -> None:
    with pytest.raises(ControlError):
        decode(b"[" * 100_000)
