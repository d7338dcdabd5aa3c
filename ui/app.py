"""The app: keys in, requests out; messages in, a situation drawn twice a second."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

from textual.app import App, ComposeResult, SystemCommand
from textual.binding import Binding, BindingType
from textual.screen import Screen
from textual.worker import Worker, WorkerState

from edge.control.messages import Request
from ui.answers import NOT_SENT, answer, goodbye, noted, unanswered
from ui.connection import Connection
from ui.faults import faults
from ui.guard import Press, StopGuard
from ui.help import help_lines
from ui.history import History
from ui.messages import Connected, ConnectionLost, Replied, StatusArrived
from ui.requests import ANSWER_S, Requests
from ui.screens.note import NoteScreen
from ui.screens.page import PageScreen
from ui.situation import Link, Situation
from ui.themes import SHADE, SUN
from ui.tone import Tone
from ui.verdict import verdict_page
from ui.widgets.banner import Banner
from ui.widgets.dashboard import Dashboard

DRAW_S = 0.5
"""Twice a second is as fast as numbers are read, and leaves room on a slow link."""
TERMINAL_S = 2.0
NOTICE_S = 8.0
RESTART_S = 2.0
CONNECTION = "connection"


@dataclass(frozen=True)
class Options:
    """How the screen behaves. ascii_only: for terminals that lack the symbols."""

    sun: bool = False
    bell: bool = False
    ascii_only: bool = False
    terminal: int | None = None
    """File descriptor of the terminal: the screen ends with it. None without one, in tests."""


class RecorderApp(App[str]):
    """The operator's screen. Handlers own all state, the connection only posts. Ends with a last word to say."""

    TITLE = "mapforest"
    COMMAND_PALETTE_BINDING = "p"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space,r", "start", "Start", key_display="SPACE"),
        Binding("space,r", "stop", "Stop", key_display="SPACE"),
        Binding("m", "mark", "Mark", key_display="M"),
        Binding("n", "note", "Note", key_display="N"),
        Binding("v", "verdict", "Verdict", key_display="V"),
        Binding("c", "colours", "Colours", key_display="C"),
        Binding("b", "toggle_bell", "Bell", key_display="B"),
        Binding("h,question_mark,f1", "help", "Help", key_display="H"),
        Binding("q,ctrl+c", "quit", "Quit", key_display="Q"),
        Binding("escape", "disarm", "Go on recording", show=False),
        Binding("down,j", "scroll(1)", "Scroll", show=False),
        Binding("up,k", "scroll(-1)", "Scroll", show=False),
    ]

    def __init__(
        self, connection: Connection, options: Options | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__()
        options = options or Options()
        self.ascii_only = options.ascii_only
        self.animation_level = "none"
        self._bell, self._sun, self._terminal = options.bell, options.sun, options.terminal
        self._connection = connection
        self._clock = clock
        self._dashboard = Dashboard()
        self._guard = StopGuard()
        self._history = History()
        self._requests = Requests()
        self._situation = Situation()
        self._status_s = self._notice_s = float("-inf")
        self._known_faults: frozenset[str] = frozenset()
        self._known_trees = 0
        self._ready_to_draw = False

    def compose(self) -> ComposeResult:
        yield self._dashboard

    def get_theme_variable_defaults(self) -> dict[str, str]:
        return SHADE.variables

    def on_mount(self) -> None:
        for theme in (SHADE, SUN):
            self.register_theme(theme)
        self.theme = (SUN if self._sun else SHADE).name

    def on_dashboard_ready(self, _: Dashboard.Ready) -> None:
        self._ready_to_draw = True
        self.draw()
        self.set_interval(DRAW_S, self.draw)
        if self._terminal is not None:
            self.set_interval(TERMINAL_S, self._end_with_terminal)
        self._connect()

    def _end_with_terminal(self) -> None:
        """A terminal that hung up reads as empty for ever: without this the screen spins, seen by nobody."""
        if self._terminal is not None and not os.isatty(self._terminal):
            self.exit()

    def on_worker_state_changed(self, event: Worker.StateChanged) -> None:
        """A connection that failed in a way it should not have is said, and made anew."""
        if event.state is WorkerState.ERROR and event.worker.group == CONNECTION:
            self.post_message(ConnectionLost(f"This screen has a fault: {event.worker.error!r}"))
            self.set_timer(RESTART_S, self._connect)

    def on_connected(self, _: Connected) -> None:
        self._situation = replace(self._situation, link=Link.ONLINE, link_problem="")
        self.draw()

    def on_connection_lost(self, message: ConnectionLost) -> None:
        self._situation = replace(self._situation, link=Link.LOST, link_problem=message.problem)
        self._requests.forget()
        self.draw()

    def on_status_arrived(self, message: StatusArrived) -> None:
        before, self._status_s = self._situation, self._clock()
        self._situation = replace(before, status=message.status)
        self._history.add(message.status, self._status_s)
        if message.status.state != "recording":
            self._guard.disarm()
        if before.status is None or message.status.state != before.state:
            self.refresh_bindings()
            self.draw()

    def on_replied(self, message: Replied) -> None:
        request = self._requests.answered(message.reply)
        if request is not None:
            self.say(*answer(request, message.reply))

    def on_banner_tapped(self, _: Banner.Tapped) -> None:
        self.press_key()

    def on_resize(self) -> None:
        self.call_after_refresh(self.draw)

    def draw(self) -> None:
        """Bring the screen up to date."""
        if not self._ready_to_draw:
            return
        now_s = self._clock()
        age_s = now_s - self._status_s if self._situation.status else 0.0
        self._situation = replace(self._situation, status_age_s=age_s, armed_s=self._guard.armed_for_s(now_s))
        self._dashboard.show(self._situation, self._history)
        for request in self._requests.overdue(now_s):
            self.say(*unanswered(request, ANSWER_S))
        if now_s - self._notice_s > NOTICE_S:
            self.say("")
        self._ring_for_news()

    def say(self, text: str, tone: Tone = Tone.QUIET) -> None:
        """Answer the operator in the line above the keys."""
        self._notice_s = self._clock()
        self._dashboard.notice.say(text, tone)

    def ask(self, request: Request) -> None:
        """Send a request; the answer becomes a notice."""
        if self._connection.send(self._requests.number(request, self._clock())):
            self.say(f"{request.command} sent")
        else:
            self._requests.forget()
            self.say(NOT_SENT, Tone.BAD)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """The one key is called Stop while recording, and Start otherwise."""
        if action in {"start", "stop"}:
            return (action == "stop") == (self._situation.state == "recording")
        return super().check_action(action, parameters)

    def action_start(self) -> None:
        self.press_key()

    def action_stop(self) -> None:
        self.press_key()

    def press_key(self) -> None:
        """The one key: start, or the first or second press of a stop."""
        if self._situation.stale:
            self.say(NOT_SENT, Tone.BAD)
            return
        match self._guard.press(self._clock(), self._situation.state):
            case Press.START:
                self.ask(Request("start"))
            case Press.STOP:
                recording = self._situation.status.recording if self._situation.status else None
                self.ask(Request("stop", session=recording.session if recording else ""))
            case Press.REST:
                self.say("Just stopped. Wait three seconds to start again.", Tone.WARN)
            case Press.ARM | Press.NOTHING:
                pass
        self.draw()

    def action_scroll(self, lines: int) -> None:
        self._dashboard.table.scroll_relative(y=lines, animate=False)

    def action_disarm(self) -> None:
        self._guard.disarm()
        self.draw()

    def action_mark(self) -> None:
        self._mark("")

    def action_note(self) -> None:
        pressed_s = self._clock()
        if self._can_mark():
            self.push_screen(NoteScreen(), partial(self._note, pressed_s))

    def action_verdict(self) -> None:
        verdict = self._situation.status.verdict if self._situation.status else None
        if verdict is None:
            self.say("No verdict yet: it comes after a stop.")
        else:
            self.push_screen(PageScreen(verdict_page(verdict)))

    def action_check_again(self) -> None:
        self.ask(Request("validate"))

    def action_colours(self) -> None:
        self.theme = SHADE.name if self.theme == SUN.name else SUN.name

    def action_toggle_bell(self) -> None:
        self._bell = not self._bell
        self.say("Bell on a new fault or tree: " + ("on" if self._bell else "off"))
        if self._bell:
            self.bell()

    def action_help(self) -> None:
        self.push_screen(PageScreen(help_lines()))

    async def action_quit(self) -> None:
        status = self._situation.status
        session = status.recording.session if status and status.recording else ""
        self.exit(goodbye(self._situation.state, session))

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """The palette offers what the keys do."""
        yield SystemCommand("Start or stop recording", "SPACE; stopping takes it twice", self.press_key)
        yield SystemCommand("Mark", "This moment, without words", self.action_mark)
        yield SystemCommand("Note", "Mark this moment, with words", self.action_note)
        yield SystemCommand("Verdict", "On the last recording, in full", self.action_verdict)
        yield SystemCommand("Check again", "Validate the last recording once more", self.action_check_again)
        yield SystemCommand("Colours", "For the shade, or for the sun", self.action_colours)
        yield SystemCommand("Bell", "Ring on a new fault or tree, or not", self.action_toggle_bell)
        yield SystemCommand("Help", "Keys, symbols and words", self.action_help)
        yield SystemCommand("Quit", "Leave this screen; a recording goes on", self.action_quit)

    def _connect(self) -> None:
        self.run_worker(self._connection.run(self.post_message), group=CONNECTION, exit_on_error=False)

    def _can_mark(self) -> bool:
        recording = self._situation.state == "recording"
        if not recording:
            self.say("Nothing to mark: not recording.", Tone.WARN)
        return recording

    def _mark(self, text: str) -> None:
        if self._can_mark():
            self.ask(Request("mark", text=text))

    def _note(self, pressed_s: float, text: str | None) -> None:
        if text is not None:
            self._mark(noted(text, self._clock() - pressed_s))

    def _ring_for_news(self) -> None:
        known, self._known_faults = self._known_faults, frozenset(fault.key for fault in faults(self._situation))
        status = self._situation.status
        had, self._known_trees = self._known_trees, status.mapped.trees if status and status.mapped else 0
        if self._bell and (self._known_faults - known or self._known_trees > had):
            self.bell()
