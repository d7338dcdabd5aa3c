"""Whatever happens to the bytes of a recording: a clear refusal, or a sound copy."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge.errors import EdgeError
from edge.recording.recover import finish_in_place, recover
from edge.recording.scan import RecordFile
from edge.validation.info import info
from edge.validation.validate import validate
from tests.edge.recordings import CODECS, read_messages, recording_bytes

BASES = [
    recording_bytes(codec, 0.4, **options)
    for codec in CODECS
    for options in ({}, {"finish": False}, {"use_chunking": False}, {"enable_crcs": False})
]
FLIP, CUT, GAP, NOISE, ZERO, ONES = range(6)
WOUNDS = st.lists(
    st.tuples(
        st.sampled_from([FLIP, CUT, GAP, NOISE, ZERO, ONES]), st.floats(0, 1), st.binary(min_size=1, max_size=40)
    ),
    min_size=1,
    max_size=6,
)


def wounded(data, wounds):
    hurt = bytearray(data)
    for kind, where, noise in wounds:
        at = min(int(where * len(hurt)), len(hurt) - 1)
        if kind == FLIP:
            hurt[at] ^= noise[0] or 1
        elif kind == CUT:
            del hurt[max(at, 1) :]
        elif kind == GAP:
            del hurt[at : min(at + 37 * len(noise), len(hurt) - 1)]
        elif kind == NOISE:
            hurt[at:at] = noise
        else:
            fill = b"\0" if kind == ZERO else b"\xff"
            hurt[at : at + len(noise)] = fill * len(noise)
    return bytes(hurt)


@settings(max_examples=150, derandomize=True)
@given(base=st.integers(0, len(BASES) - 1), wounds=WOUNDS)
def test_any_damage_ends_in_a_sound_copy_or_a_clear_refusal(tmp_path_factory, base, wounds):
    folder = tmp_path_factory.mktemp("hurt")
    path, copy, again = folder / "hurt.mcap", folder / "copy.mcap", folder / "again.mcap"
    path.write_bytes(wounded(BASES[base], wounds))
    try:
        report = recover(path, copy)
    except EdgeError:
        assert not copy.exists()
        return
    assert len(read_messages(copy)) == report.messages
    assert recover(copy, again).lossless
    assert again.read_bytes() == copy.read_bytes()
    validate(path)
    info([path])
    before = path.read_bytes()
    try:
        finish_in_place(path)
    except EdgeError:
        assert path.read_bytes() == before
        return
    with RecordFile(path) as file:
        assert file.footer() is not None


def test_a_file_that_may_not_be_opened(tmp_path, monkeypatch):
    path = tmp_path / "locked.mcap"
    path.write_bytes(recording_bytes(seconds=0.1))

    def denied(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("edge.recording.scan.os.open", denied)  # root may open anything
    with pytest.raises(EdgeError, match="not allowed to open it"):
        validate(path)


def test_a_disk_that_cannot_be_read(tmp_path, monkeypatch):
    path = tmp_path / "one.mcap"
    path.write_bytes(recording_bytes(seconds=0.1))

    def broken(*_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("edge.recording.scan.os.pread", broken)
    with pytest.raises(EdgeError, match="cannot read at byte"):
        recover(path, tmp_path / "copy.mcap")
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_leaves_nothing_behind(tmp_path, monkeypatch):
    path = tmp_path / "one.mcap"
    path.write_bytes(recording_bytes(seconds=0.1))

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("edge.recording.recover.os.fsync", full)
    with pytest.raises(EdgeError, match="choose a folder with room"):
        recover(path, tmp_path / "copy.mcap")
    assert list(tmp_path.iterdir()) == [path]
