"""Where the commands print."""

from __future__ import annotations

from rich.console import Console

_PIPED_WIDTH = 160


def console(*, stderr: bool = False) -> Console:
    """Where to print. Into a pipe lines are not folded to the width of a terminal that is not there."""
    out = Console(stderr=stderr)
    return out if out.is_terminal else Console(stderr=stderr, width=_PIPED_WIDTH)
