"""An hour is judged without reading it: bytes read stay a small share of the file."""

import os

from edge.validation.validate import validate
from tests.edge.sessions import write_session


def test_little_of_a_long_recording_is_read(tmp_path, monkeypatch):
    path = write_session(tmp_path / "long_0.mcap", seconds=240.0, session={"config_toml": ""}, payload=1500)
    read = 0
    pread = os.pread

    def counted(fd, length, offset):
        nonlocal read
        data = pread(fd, length, offset)
        read += len(data)
        return data

    monkeypatch.setattr(os, "pread", counted)
    report = validate(path)
    assert report.verdict == "PASS", report.reasons
    assert report.messages > 60_000
    sample = 48 * (64 << 10)
    assert read < sample + 0.1 * path.stat().st_size
