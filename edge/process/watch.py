"""Who is told how the work goes."""

from __future__ import annotations


class Watch:
    """This one does not listen."""

    def stage(self, name: str, *, done: bool) -> None:
        """A stage begins, or is there from an earlier run."""

    def advance(self, share: float) -> None:
        """0..1 of the stage."""
