"""Progress of long work in stages, for people."""

from __future__ import annotations

from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from edge.cli.words import console
from edge.process.watch import Watch


class StageBar(Watch):
    """One bar a stage, on standard error."""

    def __init__(self, *, quiet: bool) -> None:
        self._progress = Progress(
            TextColumn("{task.description:<9}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console(stderr=True),
            disable=quiet,
        )
        self._task: TaskID | None = None

    def __enter__(self) -> StageBar:
        self._progress.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._finish()
        self._progress.stop()

    def stage(self, name: str, *, done: bool) -> None:
        """The next one."""
        self._finish()
        self._task = self._progress.add_task(name, total=1.0, completed=int(done))

    def advance(self, share: float) -> None:
        """0..1 of it."""
        if self._task is not None:
            self._progress.update(self._task, completed=min(share, 1.0))

    def _finish(self) -> None:
        self.advance(1.0)
