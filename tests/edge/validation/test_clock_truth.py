import json

import pytest

from edge.config import Config, Recording
from edge.errors import FormatError
from edge.recording.anchor import Anchor
from edge.recording.messages import Diagnostics, DiagnosticStatus, Level
from edge.recording.session import SessionAbout, SessionRecorder
from edge.validation.clock_truth import clock_reports

S = 1_000_000_000


def diagnostics(second, error_ns):
    """The driver believes host = sensor + 5 s, off by `error_ns`."""
    values = {
        "clock.updated_ns": second * S,
        "clock.offset_ns": 5 * S + error_ns,
        "clock.skew_ppm": "0.000",
        "clock.sigma_ns": 100_000,
    }
    status = DiagnosticStatus("sensor/livox", Level.OK, "ok", "", tuple((k, str(v)) for k, v in values.items()))
    return Diagnostics((second + 5) * S, (second + 5) * S, (status,))


@pytest.fixture
def session(tmp_path):
    anchor = Anchor(utc_ns=1_800_000_000 * S, monotonic_ns=5 * S)
    config = Config(recording=Recording(min_free_mib=0, min_free_percent=0.0))
    recorder = SessionRecorder(tmp_path / "walk", SessionAbout(mission="walk"), config, anchor)
    recorder.start()
    for second in range(40):
        recorder.offer(diagnostics(second, error_ns=2_000_000))
    recorder.stop("done")
    return tmp_path / "walk"


def write_truth(folder, sensor):
    lines = [json.dumps({"host_ns": k * S // 10 + 5 * S, "sensor_ns": k * S // 10}) for k in range(400)]
    (folder / f"clock_{sensor}.jsonl").write_text("\n".join([*lines, '{"host_ns": 12']))  # the last line was cut


def test_estimates_in_the_diagnostics_are_compared_with_the_truth(session, tmp_path):
    write_truth(tmp_path, "livox")
    (report,) = clock_reports(session, tmp_path)
    assert report.sensor == "livox"
    assert report.errors.latency_ms == pytest.approx(2.0, abs=1e-3)
    assert report.errors.worst_ms == pytest.approx(0.0, abs=1e-3)


def test_missing_truth_or_clock_is_told(session, tmp_path):
    with pytest.raises(FormatError, match="no clock_"):
        clock_reports(session, tmp_path)
    write_truth(tmp_path, "reach")
    with pytest.raises(FormatError, match="no clock of 'reach'"):
        clock_reports(session, tmp_path)
