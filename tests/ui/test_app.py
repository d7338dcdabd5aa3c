"""The app under an operator's fingers, with a recorder that only listens."""

import asyncio
import contextlib

import msgspec
import pytest

from edge.control.messages import Reply
from tests.ui.fake_recorder import FakeRecorder
from tests.waiting import PATIENCE_S
from ui import samples
from ui.app import Options, RecorderApp
from ui.connection import SocketConnection
from ui.help import help_lines
from ui.messages import Connected, ConnectionLost, Replied, StatusArrived
from ui.pieces import text_of
from ui.screens.page import PageScreen
from ui.widgets.line import Line


class Recorder:
    """What the app is connected to. `heard`: its requests; `now_s`: the app's clock."""

    def __init__(self):
        self.heard = []
        self.now_s = 100.0
        self.online = True

    async def run(self, post):
        post(Connected())
        await asyncio.Event().wait()

    def send(self, request):
        if self.online:
            self.heard.append(request)
        return self.online

    @property
    def commands(self):
        return [request.command for request in self.heard]


class Operator:
    """Keys in, screen text out."""

    def __init__(self, app, pilot, recorder):
        self.app, self.pilot, self.recorder = app, pilot, recorder

    async def press(self, *keys, after_s=1.0):
        for key in keys:
            self.recorder.now_s += after_s
            await self.pilot.press(key)
        await self.pilot.pause()

    async def hears(self, message):
        self.app.post_message(message)
        await self.pilot.pause()
        self.app.draw()
        await self.pilot.pause()

    def sees(self):
        return "\n".join(str(line.content) for line in self.app.screen.query(Line) if line.display)


@contextlib.asynccontextmanager
async def operator(status=samples.READY, size=(80, 24), **options):
    recorder = Recorder()
    app = RecorderApp(recorder, Options(**options), lambda: recorder.now_s)
    async with app.run_test(size=size) as pilot:
        await pilot.pause()
        op = Operator(app, pilot, recorder)
        await op.hears(StatusArrived(status))
        yield op


@pytest.mark.parametrize("key", ["space", "r"])
async def test_one_key_starts(key):
    async with operator() as op:
        await op.press(key)
        assert op.recorder.commands == ["start"]
        await op.hears(Replied(Reply(op.recorder.heard[0].id, True, session="s1")))
        assert "Recording s1" in op.sees()


async def test_the_same_key_twice_stops_the_session_on_the_screen():
    async with operator(samples.GOOD) as op:
        await op.press("space")
        assert op.recorder.heard == []
        assert "once more within 3 s to STOP" in op.sees()
        await op.press("space")
        assert op.recorder.commands == ["stop"]
        assert op.recorder.heard[0].session == samples.SESSION


async def test_one_press_and_time_stop_nothing():
    async with operator(samples.GOOD) as op:
        await op.press("space")
        op.recorder.now_s += 2.9
        await op.hears(StatusArrived(samples.GOOD))
        await op.press("space", after_s=0.2)
        assert op.recorder.heard == []


async def test_escape_goes_on_recording():
    async with operator(samples.GOOD) as op:
        await op.press("space", "escape", "space")
        assert op.recorder.heard == []


async def test_three_quick_presses_do_not_stop_and_start_again():
    async with operator(samples.GOOD) as op:
        await op.press("space", "space", after_s=0.5)
        await op.hears(StatusArrived(samples.PASSED))
        await op.press("space", after_s=0.5)
        assert op.recorder.commands == ["stop"]
        assert "Just stopped" in op.sees()


async def test_a_tap_on_the_banner_is_a_press():
    async with operator() as op:
        await op.pilot.click("Banner")
        assert op.recorder.commands == ["start"]


async def test_m_marks_at_once():
    async with operator(samples.GOOD) as op:
        await op.press("m")
        assert op.recorder.commands == ["mark"]


async def test_a_note_is_a_mark_with_words_and_its_delay_and_space_in_it_starts_nothing():
    async with operator(samples.GOOD) as op:
        await op.press("n")
        await op.press("a", "space", "b", "enter", after_s=1.0)
        assert [(request.command, request.text) for request in op.recorder.heard] == [("mark", "a b (4 s ago)")]


async def test_a_note_can_be_left():
    async with operator(samples.GOOD) as op:
        await op.press("n", "a", "escape")
        assert op.recorder.heard == []
        assert not isinstance(op.app.screen, PageScreen)


@pytest.mark.parametrize("key", ["m", "n"])
async def test_nothing_to_mark_when_idle(key):
    async with operator() as op:
        await op.press(key)
        assert op.recorder.heard == []
        assert "not recording" in op.sees()


async def test_a_lost_recorder_is_said_with_the_age_of_what_is_shown_and_takes_no_requests():
    async with operator(samples.GOOD) as op:
        op.recorder.online = False
        op.recorder.now_s += 14
        await op.hears(ConnectionLost("It hung up."))
        assert "Trying again. It hung up." in op.sees()
        assert "Last seen 14 s ago: RECORDING" in op.sees()
        assert all(line.has_class("-stale") for line in op.app.query("SensorTable Line") if line.display)
        await op.press("space")
        assert op.recorder.heard == []
        assert "NOT sent" in op.sees()
        await op.press("m")
        assert op.recorder.heard == []


async def test_it_recovers_when_the_recorder_comes_back():
    async with operator(samples.GOOD) as op:
        await op.hears(ConnectionLost("It hung up."))
        await op.hears(Connected())
        await op.hears(StatusArrived(samples.GOOD))
        assert "Trying again" not in op.sees()
        assert not any(line.has_class("-stale") for line in op.app.query("SensorTable Line") if line.display)


async def test_a_fault_in_the_connection_is_said_and_the_screen_lives_on(monkeypatch):
    async def broken(self, post):
        raise KeyError("oops")

    monkeypatch.setattr(Recorder, "run", broken)
    async with operator(samples.GOOD) as op:
        assert "This screen has a fault: KeyError('oops')" in op.sees()


async def test_a_silent_recorder_is_noticed():
    async with operator(samples.GOOD) as op:
        op.recorder.now_s += 5
        op.app.draw()
        await op.pilot.pause()
        assert "silent for 5 s" in op.sees()


async def test_the_verdict_appears_after_the_stop_and_in_full_on_v():
    async with operator(samples.GOOD) as op:
        assert "WARN" not in op.sees()
        await op.hears(StatusArrived(samples.WARNED))
        assert "▲ WARN" in op.sees()
        assert samples.REASONS[0] in op.sees()
        assert samples.REASONS[3] not in op.sees()
        await op.press("v")
        assert samples.REASONS[3] in op.sees()
        await op.press("escape")
        assert samples.REASONS[3] not in op.sees()


async def test_a_refusal_is_shown_with_its_reason():
    async with operator() as op:
        await op.press("space")
        await op.hears(Replied(Reply(op.recorder.heard[0].id, False, "the card is full: change it")))
        assert "start refused: the card is full: change it" in op.sees()


async def test_a_missing_answer_is_noticed():
    async with operator() as op:
        await op.press("space")
        op.recorder.now_s += 6
        await op.hears(StatusArrived(samples.READY))
        assert "No answer to start" in op.sees()


async def test_the_bell_rings_once_for_a_new_fault(monkeypatch):
    rung = []
    monkeypatch.setattr(RecorderApp, "bell", lambda self: rung.append(1))
    async with operator(samples.GOOD, bell=True) as op:
        rung.clear()
        for _ in range(3):
            await op.hears(StatusArrived(msgspec.structs.replace(samples.GOOD, sensors=(samples.gopro_failed(),))))
        assert len(rung) == 1
        await op.press("b")
        await op.hears(StatusArrived(samples.TROUBLE))
        assert len(rung) == 1


async def test_colours_change_by_key_and_by_option():
    async with operator(sun=True) as op:
        assert op.app.theme == "sun"
        await op.press("c")
        assert op.app.theme == "shade"


async def test_leaving_stops_nothing_and_says_so():
    async with operator(samples.GOOD) as op:
        await op.press("q")
        assert op.recorder.heard == []
    assert "goes on" in op.app.return_value


async def test_leaving_an_idle_recorder_says_nothing():
    async with operator() as op:
        await op.press("ctrl+q")
    assert op.app.return_value == ""


async def test_the_palette_offers_what_the_keys_do():
    async with operator() as op:
        names = {command.title for command in op.app.get_system_commands(op.app.screen)}
        await op.press("p")
        assert op.app.screen is not op.app.screen_stack[0]
        await op.press("escape")
    assert {"Start or stop recording", "Mark", "Note", "Verdict", "Colours", "Help", "Quit"} <= names


async def test_ascii_only_draws_nothing_else():
    async with operator(samples.TROUBLE, ascii_only=True) as op:
        assert op.sees().isascii()
        assert "! DEGRADED" in op.sees()


@pytest.mark.parametrize("size", [(20, 8), (40, 20), (60, 24), (80, 24), (200, 60)])
async def test_every_size_is_survived_and_the_state_is_readable(size):
    async with operator(samples.TROUBLE, size=size) as op:
        assert "gopro FAILED"[: size[0] - 5] in op.sees()


async def test_a_steady_status_draws_nothing(monkeypatch):
    async with operator(samples.GOOD) as op:
        op.recorder.now_s += 0.1
        op.app.draw()
        drawn = []
        monkeypatch.setattr(Line, "update", lambda self, *_, **__: drawn.append(self))
        op.app.draw()
        assert drawn == []


async def test_the_whole_way_over_a_real_socket(tmp_path):
    async with FakeRecorder(period_s=0.02).serving(tmp_path / "s") as fake:
        app = RecorderApp(SocketConnection(tmp_path / "s"))
        async with app.run_test(size=(80, 24)) as pilot:

            async def sees(text):
                while text not in "\n".join(str(line.content) for line in app.query(Line)):
                    await pilot.pause(0.02)

            await asyncio.wait_for(sees("Press SPACE to start."), PATIENCE_S)
            await pilot.press("space")
            await asyncio.wait_for(sees("0 marks"), PATIENCE_S)
            await pilot.press("m")
            await asyncio.wait_for(sees("1 mark "), PATIENCE_S)
            assert [request.command for request in fake.heard] == ["hello", "subscribe", "start", "mark"]


def test_help_names_every_key():
    shown = "\n".join(text_of(line) for line in help_lines())
    for key in ("SPACE", "M ", "N ", "V ", "C ", "B ", "P ", "Q "):
        assert key in shown
