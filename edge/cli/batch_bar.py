"""Progress of a batch: a line for what begins and ends, and on a terminal bars for what is under way."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from edge.cli.words import console
from edge.words import duration

if TYPE_CHECKING:
    from edge.batch.plan import Step
    from edge.batch.work import Finished


class BatchBar:
    """On standard error. Called from several threads, as rich allows."""

    def __init__(self, directory: Path, sessions: int) -> None:
        self._directory, self._sessions, self._ended = directory, sessions, 0
        self._out = console(stderr=True)
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(20),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            console=self._out,
            transient=True,
            disable=not self._out.is_terminal,
        )
        self._all = self._progress.add_task("sessions", total=sessions)
        self._bars: dict[Path, TaskID] = {}

    def __enter__(self) -> BatchBar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def say(self, text: str) -> None:
        """A line."""
        self._out.print(escape(text), highlight=False, soft_wrap=True)

    def began(self, step: Step, attempt: int) -> None:
        """A worker took it; another one before it died where this is not the first."""
        self._remove(step)
        self._bars[step.session] = self._progress.add_task(f"{escape(self._name(step))} {step.stage}", total=1.0)
        if attempt > 1:
            self.say(f"{self._name(step)}: {step.stage} begins again, its worker ended (try {attempt})")
        elif not self._out.is_terminal:
            self.say(f"{self._name(step)}: {step.stage} begins")

    def went_on(self, step: Step, part: str, share: float) -> None:
        """0..1 of a part of it."""
        if (bar := self._bars.get(step.session)) is not None:
            told = f"{escape(self._name(step))} {step.stage}, {escape(part)}"
            self._progress.update(bar, description=told, completed=share)

    def finished(self, step: Step, finished: Finished) -> None:
        """Done, now or before."""
        self._remove(step)
        took = f"done in {duration(finished.seconds)}" if finished.redone else "was done"
        self._end(step, took + (f"; {finished.warning}" if finished.warning else ""), last=step.stage == "report")

    def failed(self, step: Step, reason: str) -> None:
        """The others go on."""
        self._remove(step)
        self._end(step, f"FAILED: {reason}", last=step.stage != "refine")

    def _end(self, step: Step, told: str, *, last: bool) -> None:
        if last:
            self._ended += 1
            self._progress.advance(self._all)
        count = f" ({self._ended} of {self._sessions} sessions)" if last else ""
        self.say(f"{self._name(step)}: {step.stage} {told}{count}")

    def _remove(self, step: Step) -> None:
        if (bar := self._bars.pop(step.session, None)) is not None:
            self._progress.remove_task(bar)

    def _name(self, step: Step) -> str:
        same = step.session == self._directory
        return step.name if same else str(step.session.relative_to(self._directory))
