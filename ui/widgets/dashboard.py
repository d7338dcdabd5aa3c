"""The whole screen: banner, numbers, verdict, sensors, the last answer, keys."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.containers import Vertical
from textual.message import Message
from textual.widgets import Footer

from ui.history import History
from ui.situation import Situation
from ui.widgets.banner import Banner
from ui.widgets.notice import Notice
from ui.widgets.table import SensorTable
from ui.widgets.verdict import VerdictPanel
from ui.widgets.vitals import Vitals


class Dashboard(Vertical):
    """Knows the order from top to bottom, and nothing else."""

    DEFAULT_CSS = "Dashboard { height: 1fr; }"

    class Ready(Message):
        """The parts can be shown. The app's own Ready event may come before that."""

    def __init__(self) -> None:
        super().__init__()
        self.notice = Notice()
        self.table = SensorTable()
        self._banner, self._vitals, self._verdict = Banner(), Vitals(), VerdictPanel()

    def compose(self) -> ComposeResult:
        yield from (self._banner, self._vitals, self._verdict, self.table, self.notice)
        yield Footer(show_command_palette=False)

    def on_mount(self) -> None:
        self.post_message(self.Ready())

    def show(self, situation: Situation, history: History) -> None:
        self._banner.show(situation)
        self._vitals.show(situation)
        self._verdict.show(situation)
        self.table.show(situation, history)
