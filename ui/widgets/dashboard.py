"""The whole screen: banner, numbers, verdict, sensors, the last answer, keys."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.containers import Vertical
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

    def compose(self) -> ComposeResult:
        yield Banner()
        yield Vitals()
        yield VerdictPanel()
        yield SensorTable()
        yield Notice()
        yield Footer(show_command_palette=False)

    def show(self, situation: Situation, history: History) -> None:
        self.query_one(Banner).show(situation)
        self.query_one(Vitals).show(situation)
        self.query_one(VerdictPanel).show(situation)
        self.query_one(SensorTable).show(situation, history)
