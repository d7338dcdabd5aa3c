"""The recorder as a process, operated from the command line, ended by a signal."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader

from edge.cli import exit_codes
from edge.cli.main import main
from edge.control.client import ControlClient
from edge.errors import ControlError
from tests.waiting import PATIENCE_S, wait_for

ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def leave_logging_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("edge.cli.main._set_up_logging", lambda _verbose: None)


@pytest.fixture
def config_path(tmp_path: Path) -> Path:
    path = tmp_path / "mapforest.toml"
    path.write_text(
        f'[recording]\nfolder = "{tmp_path}/recordings"\nmin_free_mib = 0\nmin_free_percent = 0\n'
        f'[control]\nsocket = "{tmp_path}/control.sock"\n[sensors]\n'
    )
    return path


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(PATIENCE_S)
        yield listening


@pytest.fixture
def recorder(config_path: Path, tmp_path: Path, systemd: socket.socket) -> Iterator[subprocess.Popen[bytes]]:
    environ = {**os.environ, "NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "20000000"}
    command = [sys.executable, "-m", "edge.cli.main", "recorder", "--config", str(config_path)]
    with subprocess.Popen(command, cwd=ROOT, env=environ) as process:
        for awaited in (b"READY=1", b"WATCHDOG=1"):
            while systemd.recv(1000) != awaited:
                assert process.poll() is None
        yield process
        if process.poll() is None:
            process.kill()


def command_line(capsys: pytest.CaptureFixture[str], config_path: Path, *words: str) -> tuple[int, dict]:
    code = main([words[0], "--json", "--config", str(config_path), *words[1:]])
    out = capsys.readouterr().out
    return code, json.loads(out) if out else {}


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_during_a_recording_leaves_a_finished_session(
    recorder: subprocess.Popen[bytes],
    config_path: Path,
    systemd: socket.socket,
    capsys: pytest.CaptureFixture[str],
    number: signal.Signals,
) -> None:
    code, started = command_line(capsys, config_path, "start", "--mission", "plot 7")
    assert (code, started["ok"]) == (exit_codes.GOOD, True)
    assert command_line(capsys, config_path, "mark", "a", "tree")[0] == exit_codes.GOOD
    code, status = command_line(capsys, config_path, "status")
    assert status["recording"]["session"] == started["session"]
    recorder.send_signal(number)
    assert recorder.wait(PATIENCE_S) == 0
    folder = Path(started["folder"])
    (split,) = folder.glob("*.mcap")
    with split.open("rb") as file:
        topics = [channel.topic for _, channel, _ in make_reader(file).iter_messages()]
    assert "/events" in topics
    assert json.loads((folder / "session.json").read_text())["state"] == "finished"
    assert (folder / "metadata.yaml").exists()
    assert not (config_path.parent / "control.sock").exists()
    while systemd.recv(1000) != b"STOPPING=1":
        continue


def test_a_stop_on_the_command_line_brings_a_verdict(
    recorder: subprocess.Popen[bytes], config_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["start", "--config", str(config_path)]) == exit_codes.GOOD
    assert capsys.readouterr().out.startswith("recording ")
    code, stopped = command_line(capsys, config_path, "stop")
    assert code == exit_codes.GOOD
    with ControlClient(config_path.parent / "control.sock") as client:
        wait_for(lambda: (verdict := client.status().verdict) and not verdict.running)
        verdict = client.status().verdict
    assert verdict is not None
    assert verdict.session == stopped["session"]
    assert verdict.verdict in {"PASS", "WARN", "FAIL"}
    assert not any("not validated" in reason for reason in verdict.reasons)
    main(["status", "--config", str(config_path)])
    shown = capsys.readouterr().out
    assert shown.startswith("IDLE\n")
    assert f"verdict  {verdict.verdict} {verdict.session}" in shown


def test_without_a_recorder_the_command_line_says_what_to_do(
    config_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["status", "--config", str(config_path)]) == exit_codes.FAILED
    assert "not running" in capsys.readouterr().err


def test_a_bad_configuration_ends_the_recorder_at_once(config_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config_path.write_text("[recording]\nsplit_sec = 3\n")
    assert main(["recorder", "--config", str(config_path)]) == exit_codes.FAILED
    assert "did you mean 'split_s'?" in capsys.readouterr().err


def test_a_killed_recorder_leaves_a_socket_that_stops_nobody(
    recorder: subprocess.Popen[bytes], config_path: Path
) -> None:
    recorder.kill()
    recorder.wait(PATIENCE_S)
    path = config_path.parent / "control.sock"
    assert path.exists()
    with pytest.raises(ControlError, match="not running"):
        ControlClient(path).status()


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("edge.service.service", ["numba", "cv2", "av", "scipy", "textual", "rich", "foxglove", "edge.validation"]),
        ("edge.cli.start", ["numpy", "mcap", "textual", "rich", "edge.service"]),
        ("edge.cli.status", ["numpy", "mcap", "textual", "rich", "edge.service"]),
    ],
)
def test_nothing_is_loaded_that_is_not_needed(module: str, heavy: list[str]) -> None:
    script = f"import sys, {module}; print([name for name in {heavy} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"
