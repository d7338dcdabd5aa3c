"""`mapforest tui`: options in, the last word out, and nothing of it in the service."""

import argparse
import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest

from edge.cli import exit_codes, tui
from edge.errors import UsageError
from tests.waiting import PATIENCE_S


def arguments(*words):
    parser = argparse.ArgumentParser()
    parser.add_argument("--config", type=Path, default=None)
    parser.add_argument("--json", action="store_true")
    tui.add_arguments(parser)
    return parser.parse_args(words)


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setattr(tui, "has_terminal", lambda: True)


@pytest.fixture
def shown(monkeypatch):
    calls = []

    def run(socket_path, **options):
        calls.append((socket_path, options))
        return "The recording goes on."

    monkeypatch.setattr("ui.command.run", run)
    return calls


def test_options_reach_the_screen_and_its_last_word_is_printed(terminal, shown, capsys):
    assert tui.run(arguments("--socket", "/x/s", "--sun", "--bell")) == exit_codes.GOOD
    assert shown == [(Path("/x/s"), {"sun": True, "bell": True, "ascii_only": False})]
    assert capsys.readouterr().out == "The recording goes on.\n"


def test_the_socket_of_the_configuration_is_the_default(terminal, shown, tmp_path):
    config = tmp_path / "mapforest.toml"
    config.write_text(f'[control]\nsocket = "{tmp_path}/c.sock"\n')
    tui.run(arguments("--config", str(config)))
    assert shown[0][0] == tmp_path / "c.sock"


@pytest.mark.parametrize("words", [(), ("--json",)])
def test_without_a_terminal_it_names_the_command_for_programs(words):
    with pytest.raises(UsageError, match="status --json"):
        tui.run(arguments(*words))


def test_the_command_table_and_the_service_never_load_textual():
    code = (
        "import sys, importlib, pkgutil, edge.cli.tui, edge.service;"
        "[importlib.import_module(m.name) for m in pkgutil.iter_modules(edge.service.__path__, 'edge.service.')];"
        "print([name for name in ('textual', 'ui') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_screen_whose_terminal_hung_up_ends(tmp_path):
    # As when the link drops and nobody passes the hang-up on as a signal.
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "edge.cli.main", "tui", "--socket", str(tmp_path / "nobody.sock")]
    with subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, start_new_session=True) as screen:
        os.close(slave)
        shown = b""
        while b"systemctl" not in shown:  # drawn: what to do about a recorder that is not there
            shown += os.read(master, 65536)
        os.close(master)
        try:
            assert screen.wait(PATIENCE_S) is not None
        finally:
            screen.kill()
