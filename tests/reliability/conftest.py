"""Figures of the fault table: each row says what was lost and what was told, and pytest prints it at the end."""

from __future__ import annotations

from collections.abc import Callable

import pytest

_ROWS = pytest.StashKey[list[str]]()


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_ROWS] = []


@pytest.fixture
def figures(request: pytest.FixtureRequest) -> Callable[..., None]:
    """`figures("what was lost", told)` notes a row."""

    def note(lost: str, told: object = ()) -> None:
        lines = [told] if isinstance(told, str) else list(told)  # type: ignore[call-overload]
        request.config.stash[_ROWS].append("\n    ".join([f"{request.node.name}: {lost}", *lines]))

    return note


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for row in terminalreporter.config.stash[_ROWS]:
        terminalreporter.write_line(row)
