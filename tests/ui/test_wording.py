"""What is shown, from a status, without a terminal."""

from dataclasses import replace

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.control.messages import Clock, Detecting, Gnss, Location, Reply, Request, Stream, Verdict
from ui import samples
from ui.answers import answer, goodbye, noted
from ui.faults import faults
from ui.headline import headline
from ui.history import History
from ui.letters import big
from ui.pieces import fit, text_of
from ui.requests import ANSWER_S, Requests
from ui.sensors import columns, header, rate_tone, rows
from ui.situation import Link, Situation
from ui.sparks import BARS, sparkline
from ui.tone import SYMBOLS, Tone, worst
from ui.verdict import verdict_lines
from ui.vitals import LABELS, detecting_line, gnss_line, gnss_tone, location_line, vitals

GOOD = Situation(Link.ONLINE, samples.GOOD)


def changed(struct, **changes):
    return msgspec.structs.replace(struct, **changes)


def test_recording_well_is_said_in_word_tone_and_time():
    shown = headline(GOOD)
    assert (shown.word, shown.tone, shown.clock) == ("RECORDING", Tone.GOOD, "0:12:34")
    assert "3 marks" in shown.detail
    assert samples.SESSION in shown.detail


def test_idle_says_which_key_starts():
    shown = headline(Situation(Link.ONLINE, samples.READY))
    assert (shown.word, shown.tone) == ("NOT RECORDING", Tone.QUIET)
    assert "SPACE" in shown.detail


def test_a_failed_sensor_turns_a_recording_red_and_is_named_first():
    shown = headline(Situation(Link.ONLINE, samples.TROUBLE))
    assert (shown.word, shown.tone) == ("RECORDING", Tone.BAD)
    assert shown.news.startswith("✗ gopro FAILED  ▲ reach DEGRADED")


def test_the_armed_stop_counts_down_in_words():
    shown = headline(replace(GOOD, armed_s=2.2))
    assert shown.word == "STOP?"
    assert "once more within 3 s" in shown.detail
    assert "Esc" in shown.detail


def test_no_contact_says_why_what_was_so_and_what_to_do():
    shown = headline(replace(GOOD, link=Link.LOST, status_age_s=14, link_problem="It hung up."))
    assert (shown.word, shown.tone) == ("NO CONTACT", Tone.BAD)
    assert "Trying again. It hung up." in shown.detail
    assert "14 s ago: RECORDING 0:12:34" in shown.news
    assert "systemctl" in shown.advice


def test_a_silent_recorder_is_no_contact_either():
    shown = headline(replace(GOOD, status_age_s=3.5))
    assert shown.word == "NO CONTACT"
    assert "silent for 4 s" in shown.detail


def test_stopping_asks_for_patience():
    shown = headline(Situation(Link.ONLINE, changed(samples.GOOD, state="stopping")))
    assert shown.word == "STOPPING"
    assert "power" in shown.detail


@pytest.mark.parametrize(("state", "tone"), [("idle", Tone.WARN), ("recording", Tone.BAD)])
def test_a_missing_sensor_is_worse_during_a_recording(state, tone):
    status = changed(samples.GOOD, state=state, sensors=(samples.livox(state="searching", streams=()),))
    assert [fault.tone for fault in faults(Situation(Link.ONLINE, status))] == [tone]


def test_losses_a_slow_card_and_the_recorders_own_problems_are_faults():
    recording = changed(samples.RECORDING, dropped=12, flush_ms=4200.0)
    status = changed(samples.GOOD, recording=recording, problems=("card nearly full: change it",))
    found = faults(Situation(Link.ONLINE, status))
    assert [fault.tone for fault in found] == [Tone.BAD, Tone.BAD, Tone.WARN]
    assert "12 messages LOST" in found[1].text
    assert "4.2 s" in found[2].text


def test_an_unknown_sensor_state_is_taken_seriously():
    status = changed(samples.GOOD, sensors=(samples.livox(state="melting"),))
    assert faults(Situation(Link.ONLINE, status))[0].tone is Tone.BAD


def test_a_sensor_has_a_row_a_stream_and_its_extras_below_the_badge():
    lines = [text_of(line) for line in rows(samples.livox(), History(), columns(77), True)]
    assert len(lines) == 2
    assert "livox" in lines[0]
    assert "✓ OK" in lines[0]
    assert "10.0 / 10" in lines[0]
    assert "±0.31ms" in lines[0]
    assert "52 °C" in lines[1]
    assert "200 / 200" in lines[1]


def test_a_problem_is_followed_by_what_to_do():
    lines = [text_of(line) for line in rows(samples.gopro_failed(), History(), columns(77), True)]
    assert lines[-2].startswith("✗ No picture")
    assert lines[-1].startswith("→ Change its battery")
    assert "▲ bat 4%" in lines[1]


def test_a_sensor_that_sends_nothing_takes_one_row_for_its_streams():
    silent = tuple(changed(stream, rate_hz=0.0) for stream in samples.livox().streams)
    sensor = samples.livox(state="searching", streams=silent, temperature_c=None, problem="gone", advice="look")
    lines = [text_of(line) for line in rows(sensor, History(), columns(77), True)]
    assert len(lines) == 3
    assert lines[1:] == ["✗ gone", "→ look"]


def test_a_sensor_that_sends_nothing_still_has_its_row():
    sensor = samples.livox(state="searching", streams=(), clock=None, temperature_c=None)
    assert [text_of(line).split() for line in rows(sensor, History(), columns(77), False)] == [
        ["livox", "▲", "SEARCHING"]
    ]


@given(st.integers(30, 200))
def test_no_row_is_wider_than_the_table(width):
    widths = columns(width)
    streams = (Stream("lidar", 9999.4, 29.97, 10**9, 10**8, 3599.0), Stream("a-long-name", 0.0, 0.0, 0, 0, 0.0))
    sensor = samples.livox(name="a-very-long-name", streams=streams, clock=Clock(987.0, 0.0, 0.0, 0))
    table = [header(widths), *rows(sensor, History(), widths, True)]
    longest = max(len(text_of(line)) for line in table)
    assert longest <= max(width, 43)
    if width >= 66:
        assert len(text_of(table[0])) == len(text_of(table[1]))


@pytest.mark.parametrize(("rate", "tone"), [(10.9, Tone.GOOD), (11.2, Tone.WARN), (8.9, Tone.WARN), (4.9, Tone.BAD)])
def test_a_rate_is_judged_against_its_nominal(rate, tone):
    assert rate_tone(Stream("lidar", rate, 10.0, 0, 0, 0.0)) is tone


def test_a_rate_without_nominal_is_not_judged():
    assert rate_tone(Stream("nmea", 3.0, 0.0, 0, 0, 0.0)) is Tone.QUIET


def test_losses_are_marked_while_they_grow_and_not_after():
    history = History()
    for second, lost in enumerate((5, 5, 9)):
        history.add(
            changed(samples.GOOD, sensors=(samples.livox(streams=(Stream("lidar", 10, 10, 0, lost, 0.1),)),)), second
        )
    assert history.of("livox", "lidar").losing
    for second in range(3, 20):
        history.add(
            changed(samples.GOOD, sensors=(samples.livox(streams=(Stream("lidar", 10, 10, 0, 9, 0.1),)),)), second
        )
    assert not history.of("livox", "lidar").losing


def test_history_takes_one_sample_a_second_however_fast_statuses_come():
    history = History()
    for quarter in range(41):
        history.add(samples.GOOD, quarter * 0.25)
    assert len(history.of("livox", "lidar").ratios) == 11


def test_sparkline_is_right_aligned_with_nothing_on_the_base_line():
    assert sparkline([0.0, 0.5, 1.0, 9.0], 6) == "  ▁▃▅▇"
    assert sparkline([1.0] * 9, 3) == "▅▅▅"
    assert sparkline([1.0], 0) == ""


@given(st.lists(st.floats(allow_nan=True)), st.integers(0, 80))
def test_sparkline_has_its_width_whatever_comes(ratios, width):
    shown = sparkline(ratios, width)
    assert len(shown) == width
    assert set(shown) <= {*BARS, " "}


def test_every_word_of_the_banner_can_be_drawn():
    for word in ("RECORDING", "NOT RECORDING", "STOPPING", "STOP?", "NO CONTACT", "CONNECTING", "0123456789:"):
        rows_ = big(word)
        assert len({len(row) for row in rows_}) == 1
        assert len(rows_[0]) <= 78


def test_symbols_differ_and_are_one_cell():
    assert len(set(SYMBOLS.values())) == len(Tone)
    assert worst(Tone.GOOD, Tone.BAD, Tone.WARN) is Tone.BAD
    assert worst() is Tone.QUIET


def test_vitals_warn_with_a_symbol():
    shown = {vital.label: vital.shown for vital in vitals(samples.TROUBLE)}
    assert shown["CARD LEFT"] == "▲ 11m"
    assert shown["QUEUE"] == "▲ 56 %"
    assert shown["THROTTLED"] == "▲ 88 °C"
    assert shown["CLOCK"] == "▲ no sync"
    assert [vital.label for vital in vitals(None)] == list(LABELS)


@pytest.mark.parametrize(
    ("quality", "age_s", "tone"), [(4, 0.1, Tone.GOOD), (1, 0.1, Tone.WARN), (0, 0.1, Tone.BAD), (4, 9, Tone.BAD)]
)
def test_gnss_quality(quality, age_s, tone):
    assert gnss_tone(Gnss(quality, "RTK fixed", 14, 0.02, 0.03, age_s)) is tone


def test_gnss_says_sigma_and_when_it_is_old():
    assert "±0.02 m across" in text_of(gnss_line(Gnss(4, "RTK fixed", 14, 0.02, 0.03, 12.0)))
    assert "12 s old" in text_of(gnss_line(Gnss(4, "RTK fixed", 14, 0.02, 0.03, 12.0)))
    assert "NO DATA" in text_of(gnss_line(None))


def test_a_verdict_names_its_reasons_worst_first_and_how_many_more():
    lines = [text_of(line) for line in verdict_lines(Verdict("s", "FAIL", ("a", "b", "c")), 2)]
    assert "✗ FAIL" in lines[0]
    assert [line.split() for line in lines[1:3]] == [["✗", "a"], ["✗", "b"]]
    assert "1 more" in lines[3]
    assert "CHECKING" in text_of(verdict_lines(Verdict("s", "", running=True), 2)[0])


def test_answers():
    assert answer(Request("start"), Reply(1, True, session="x")) == ("Recording x", Tone.GOOD)
    assert answer(Request("start"), Reply(1, False, "the card is full")) == (
        "start refused: the card is full",
        Tone.BAD,
    )
    assert answer(Request("mark", text="hut"), Reply(1, True)) == ("Marked: hut", Tone.GOOD)
    assert goodbye("idle", "") == ""
    assert "goes on: x" in goodbye("recording", "x")


def test_a_note_says_how_long_it_took_to_write():
    assert noted("hut", 0.4) == "hut"
    assert noted("hut", 7.6) == "hut (8 s ago)"
    assert noted("", 7.6) == "(8 s ago)"


def test_an_unanswered_request_is_reminded_of_once_and_may_still_be_answered():
    requests = Requests()
    asked = requests.number(Request("start"), 0.0)
    assert requests.overdue(ANSWER_S) == ()
    assert requests.overdue(ANSWER_S + 0.1) == (asked,)
    assert requests.overdue(ANSWER_S + 9) == ()
    assert requests.answered(Reply(asked.id, True)) == asked
    assert requests.answered(Reply(asked.id, True)) is None


def test_fit_shows_that_something_was_cut():
    assert fit("abcdef", 4) == "abc…"
    assert fit("abcd", 4) == "abcd"
    assert fit("abcd", 0) == ""


DETECTING = Detecting("watching", "ailanthus", "ab12", "cuda", 2.0, 180.4, 3)


def test_the_detector_says_boxes_pace_and_delay_and_what_is_wrong():
    assert "WATCHING" in text_of(detecting_line(DETECTING))
    assert text_of(detecting_line(DETECTING)).endswith("  3 boxes  2.0/s  180 ms  ailanthus on cuda")
    slowed = changed(DETECTING, state="slowed", note="80 °C: 1.0 images/s")
    assert text_of(detecting_line(slowed)).endswith("80 °C: 1.0 images/s")
    failed = Detecting("failed", "gone.onnx", note="no such file")
    assert text_of(detecting_line(failed)).endswith("FAILED      no such file")
    assert any(Tone.BAD.badge == style for _, style in detecting_line(failed))


LOCATION = Location("tracking", 812.4, 1.3, 0.42, (12.34, -5.0, 1.0), True, 0, 1.0, 0.1)


def test_the_pose_says_way_speed_and_sigma_and_what_was_left_out():
    assert "TRACKING" in text_of(location_line(LOCATION))
    assert "812 m  1.3 m/s  ±0.42 m map  +12.3 -5.0 +1.0" in text_of(location_line(LOCATION))
    behind = changed(LOCATION, thinned=0.4, dropped=7)
    assert "40% of the points, 7 sweeps left out" in text_of(location_line(behind))
    starting = changed(LOCATION, state="starting", note="keep still for a moment")
    assert text_of(location_line(starting)).endswith("keep still for a moment")
    unsure = changed(LOCATION, state="degenerate", note="no points for 2.0 s")
    assert text_of(location_line(unsure)).endswith("no points for 2.0 s")
    assert any(Tone.BAD.badge == style for _, style in location_line(changed(LOCATION, state="lost")))
