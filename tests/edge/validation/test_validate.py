"""The verdict: right word, right reason, for everything that goes wrong in the field."""

import msgspec
import pytest

from edge.config import Config, Expectation, Validation
from edge.errors import FormatError
from edge.validation.report import Level
from edge.validation.validate import validate
from tests.edge.sessions import write_session

OURS = {"software": "test", "config_toml": ""}


def judged(tmp_path, config=None, **options):
    session = options.pop("session", OURS)
    return validate(write_session(tmp_path / "one_0.mcap", session=session, **options), config)


@pytest.mark.parametrize("codec", ["none", "lz4", "zstd"])
def test_a_good_session_passes(tmp_path, codec):
    report = judged(tmp_path, codec=codec)
    assert report.reasons == ()
    assert report.verdict == "PASS"
    assert report.own
    table = {topic.name: topic for topic in report.topics}
    assert table["/livox/imu"].count == 4000
    assert table["/livox/imu"].rate_hz == pytest.approx(200, rel=1e-6)
    assert table["/livox/lidar"].expected_hz == 10
    assert report.duration_s == pytest.approx(20, abs=0.01)
    assert report.gnss is not None
    assert report.gnss.fix_share == 1
    assert msgspec.json.decode(msgspec.json.encode(report))["verdict"] == "PASS"


WRONG = {
    "dead tail": ({"imu": {"end_s": 12.0}}, "FAIL", "stopped 8.0 s before the end", "/livox/imu"),
    "short tail": ({"lidar": {"end_s": 18.0}}, "WARN", "stopped", "/livox/lidar"),
    "late start": ({"video": {"start_s": 6.0}}, "WARN", "began only 6.0 s after the start", "/camera/video"),
    "gap": ({"lidar": {"silent": ((5.05, 5.95),)}}, "WARN", "silent for 1.00 s at second 5.0", "/livox/lidar"),
    "long gap": ({"imu": {"silent": ((5.0, 8.0),)}}, "FAIL", "silent for 3.0", "/livox/imu"),
    "low rate": ({"imu": {"rate_hz": 150.0}}, "FAIL", "delivered 150 messages a second instead of 200", "/livox/imu"),
    "high rate": ({"lidar": {"rate_hz": 20.0}}, "WARN", "20 messages a second instead of 10", "/livox/lidar"),
    "missing": ({"video": None}, "FAIL", "Nothing was recorded from the camera", "/camera/video"),
    "type": ({"lidar": {"type_name": "std_msgs/msg/String"}}, "FAIL", "holds std_msgs/msg/String", "/livox/lidar"),
    "back": ({"imu": {"stamp_jumps": {900: -3.0}}}, "FAIL", "go backwards 1 times, by up to 2.995 s", "/livox/imu"),
    "twice": ({"fix": {"stamp_jumps": {9: -0.2}}}, "WARN", "same time as the one before", "/gnss/fix"),
    "latency": ({"lidar": {"latency_s": 1e6}}, "WARN", "12 days behind", "/livox/lidar"),
    "minor": ({"diagnostics": {"rate_hz": 0.2}}, "WARN", "health report delivered 0.2 messages", "/diagnostics"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said(tmp_path, name):
    changes, verdict, words, topic = WRONG[name]
    report = judged(tmp_path, changes=changes)
    assert report.verdict == verdict
    found = [finding for finding in report.findings if words in finding.text]
    assert found, report.reasons
    assert found[0].topic == topic
    assert found[0].advice
    line = next(one for one in report.topics if one.name == topic)
    assert line.level == max(finding.level for finding in report.findings if finding.topic == topic)


def test_fixes_at_ten_hertz_are_as_good_as_at_five(tmp_path):
    assert judged(tmp_path, changes={"fix": {"rate_hz": 10.0}}).verdict == "PASS"


def test_missing_geometry_fails(tmp_path):
    report = judged(tmp_path, tf=False)
    assert report.missing == ("/tf_static",)
    assert "mounting geometry" in report.reasons[0]


def test_only_configured_sensors_are_required(tmp_path):
    config = '[sensors.scanner]\ndriver = "livox"\n'
    changes = {"video": None, "fix": None, "nmea": None}
    assert judged(tmp_path, changes=changes, session=OURS | {"config_toml": config}).verdict == "PASS"
    assert judged(tmp_path, changes=changes).verdict == "FAIL"


def test_the_configuration_sets_topics_and_limits(tmp_path):
    wanted = {"/livox/imu": Expectation(rate_hz=100.0), "/extra": Expectation(rate_hz=1.0, required=False)}
    config = Config(validation=Validation(topics=wanted))
    report = judged(tmp_path, config, changes={"imu": {"rate_hz": 100.0}})
    assert report.verdict == "WARN"
    assert [finding.topic for finding in report.findings if finding.level > Level.NOTE] == ["/extra"]


def test_worst_reason_comes_first(tmp_path):
    report = judged(tmp_path, changes={"diagnostics": {"rate_hz": 0.2}, "imu": None})
    assert report.verdict == "FAIL"
    assert "motion sensor" in report.reasons[0]
    assert [finding.level for finding in report.findings] == sorted(
        (finding.level for finding in report.findings), reverse=True
    )


def test_the_word_of_the_recorder_counts(tmp_path):
    summary = {
        "dropped": {"/camera/video": {"count": 12, "first_ns": 1, "last_ns": 2}},
        "diagnostics": {
            "sensor/livox": {"level": 0, "message": "ok", "values": {"points.lost": "300", "points.received": "9700"}},
            "sensor/gopro": {"level": 0, "message": "", "values": {"clock.sigma_ns": "8500000"}},
            "recorder": {"level": 1, "message": "", "values": {"dropped": "12"}},
        },
        "gnss_quality": {"0": 70, "4": 30},
        "clock": {"synchronised_at_start": False, "source": "", "drift_ms": 0.0, "steps": 0},
        "something new": [1, 2],
    }
    report = judged(tmp_path, summary=summary)
    said = " ".join(report.reasons)
    assert "leave out 12 messages of /camera/video" in said
    assert "3.0% were lost (livox points: 300)" in said
    assert "clock of gopro is known only to 8.5 ms" in said
    assert "position only 30% of the time (the recorder's count)" in said
    assert report.lost == {"livox points": 300}
    assert report.clock_sigma_ms == {"gopro": 8.5}
    assert report.gnss.qualities == {"no fix": 70, "RTK fixed": 30}
    assert any("clock was not set" in f.text and f.level == Level.NOTE for f in report.findings)
    assert report.verdict == "WARN"


def test_losses_are_those_of_the_session_in_the_unit_they_are_counted_in(tmp_path):
    def notes(lost, packets, scans):
        values = {"points.lost": lost, "points.units": packets, "points.received": scans}
        return {"sensor/livox": {"values": {key: str(value) for key, value in values.items()}}}

    summary = {"first_diagnostics": notes(9000, 50_000, 240), "diagnostics": notes(9500, 59_500, 290)}
    report = judged(tmp_path, summary=summary)
    assert report.lost == {"livox points": 500}
    assert "5.0% were lost (livox points: 500)" in " ".join(report.reasons)
    restarted = {"first_diagnostics": notes(9000, 50_000, 240), "diagnostics": notes(10, 990, 5)}
    assert judged(tmp_path, summary=restarted).lost == {"livox points": 10}


@pytest.mark.parametrize("codec", ["none", "lz4"])
def test_gnss_share_is_read_from_the_fixes(tmp_path, codec):
    report = judged(tmp_path, codec=codec, statuses=(-1, -1, -1, 0, 2))
    assert report.verdict == "WARN"
    assert report.gnss.fix_share == pytest.approx(0.4, abs=0.02)
    assert "only 40% of the time" in report.reasons[0]
    never = judged(tmp_path, codec=codec, statuses=(-1,))
    assert "never had a position" in never.reasons[0]


def test_splits_are_judged_as_one(tmp_path):
    for number in range(3):
        write_session(tmp_path / f"walk_{number}.mcap", seconds=5.0, session=OURS, start_s=5.0 * number)
    report = validate(tmp_path)
    assert report.verdict == "PASS", report.reasons
    assert len(report.files) == 3
    assert report.duration_s == pytest.approx(15, abs=0.01)
    (tmp_path / "walk_1.mcap").unlink()
    report = validate(tmp_path)
    assert report.verdict == "FAIL"
    assert any("Part 1 of the recording is missing" in reason for reason in report.reasons)


def test_an_open_file_is_judged_and_said_to_be_open(tmp_path):
    path = write_session(tmp_path / "walk_0.mcap.active", session=OURS, finish=False)
    report = validate(tmp_path)
    assert report.verdict == "WARN"
    assert "was not closed" in report.reasons[0]
    assert "mapforest recover" in report.reasons[0]
    path.write_bytes(path.read_bytes()[:-1000])
    torn = validate(path)
    assert any("cut off" in reason for reason in torn.reasons)


def test_how_it_ended_is_said(tmp_path):
    cut = judged(tmp_path, summary={})
    assert cut.verdict == "WARN"
    assert "cut off (power?)" in cut.reasons[0]
    full = judged(tmp_path, summary={"ended": "disk reserve reached"})
    assert full.verdict == "WARN"
    assert "by itself: disk reserve reached" in full.reasons[0]


def test_a_damaged_chunk_fails(tmp_path):
    path = write_session(tmp_path / "walk.mcap", session=OURS, seconds=10.0)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    report = validate(path)
    assert report.verdict == "FAIL"
    assert "damaged" in report.reasons[0]


def test_foreign_recordings_are_judged_by_type_against_themselves(tmp_path):
    path = write_session(tmp_path / "bag_0.mcap", session=None, changes={"lidar": {"rate_hz": 20.0}, "video": None})
    report = validate(path)
    assert not report.own
    assert report.verdict == "PASS", report.reasons
    assert {one.name: one.expected_hz for one in report.topics}["/livox/lidar"] == pytest.approx(20, rel=1e-3)
    holes = {"imu": {"silent": ((3.0, 4.0), (6.0, 9.0))}, "lidar": {"end_s": 12.0}}
    report = validate(write_session(tmp_path / "bag_1.mcap", session=None, changes=holes))
    assert report.verdict == "WARN"
    assert {finding.topic for finding in report.findings if finding.level > Level.NOTE} == {
        "/livox/imu",
        "/livox/lidar",
    }


def test_nothing_recorded_fails(tmp_path):
    report = judged(tmp_path, seconds=0.0, tf=False)
    assert report.verdict == "FAIL"
    assert "no messages" in report.reasons[0]


def test_clear_refusals(tmp_path):
    with pytest.raises(FormatError, match="no recording"):
        validate(tmp_path)
    with pytest.raises(FormatError, match="no such file"):
        validate(tmp_path / "none.mcap")
    (tmp_path / "old.db3").write_bytes(b"x")
    with pytest.raises(FormatError, match="sqlite3"):
        validate(tmp_path)
    (tmp_path / "a.mcap").write_bytes(b"")
    with pytest.raises(FormatError, match="empty"):
        validate(tmp_path)
    write_session(tmp_path / "b.mcap", session=OURS)
    report = validate(tmp_path)
    assert "a.mcap cannot be read" in report.reasons[0]


def test_a_part_given_up_by_the_repair_fails(tmp_path):
    write_session(tmp_path / "walk_0.mcap", session=OURS)
    (tmp_path / "walk_1.mcap.damaged").write_bytes(b"?")
    report = validate(tmp_path)
    assert report.verdict == "FAIL"
    assert "walk_1.mcap.damaged cannot be read" in report.reasons[0]
