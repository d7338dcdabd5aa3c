"""What `mapforest batch` refuses, and what it prints at the end."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("distributed", reason="the extra `cluster` is not installed")

from edge.batch.schedule import Outcome
from edge.batch.work import Finished
from edge.cli import batch, exit_codes
from edge.cli.main import main


@pytest.fixture
def directory(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "session.json").touch()
        (tmp_path / name / f"{name}_0.mcap").touch()
    return tmp_path.resolve()


@pytest.fixture
def ends_with(monkeypatch):
    monkeypatch.setattr(batch, "end_with_the_terminal", lambda: None)

    def install(*outcomes):
        monkeypatch.setattr(batch, "_worked", lambda *_: list(outcomes))

    return install


def outcome(folder, warning="", **failed):
    done = Finished(str(folder / "products" / "report.html"), ("odometry",), 75.0, warning)
    return Outcome(str(folder), {} if failed else {"process": done}, failed)


def test_the_list_has_each_sessions_own_reason_and_the_exit_code_says_that_one_failed(directory, ends_with, capsys):
    ends_with(outcome(directory / "a"), outcome(directory / "b", process="b: no pose could be estimated"))
    assert main(["batch", str(directory)]) == exit_codes.FAILED
    told = capsys.readouterr().out
    assert "1 of 2 sessions done, 1 failed" in told
    assert "a/products/report.html" in told
    assert "1 min 15 s" in told
    assert "b process: b: no pose could be estimated" in told
    assert main(["batch", str(directory), "--json"]) == exit_codes.FAILED
    assert [one["failed"] for one in json.loads(capsys.readouterr().out)][1] == {
        "process": "b: no pose could be estimated"
    }


def test_warnings_and_success_have_their_exit_codes(directory, ends_with, capsys):
    ends_with(outcome(directory / "a"), outcome(directory / "b", warning="not on the Earth"))
    assert main(["batch", str(directory)]) == exit_codes.WARNINGS
    assert "not on the Earth" in capsys.readouterr().out
    ends_with(outcome(directory / "a"), outcome(directory / "b"))
    assert main(["batch", str(directory)]) == exit_codes.GOOD


def test_nothing_is_begun_where_nothing_makes_sense(directory, ends_with, capsys, tmp_path_factory):
    ends_with()
    assert main(["batch", str(tmp_path_factory.mktemp("empty"))]) == exit_codes.USAGE
    assert "is empty" in capsys.readouterr().err
    assert main(["batch", str(directory), "--workers", "0"]) == exit_codes.USAGE
    assert "one at least" in capsys.readouterr().err
    with pytest.raises(SystemExit) as left:
        main(["batch", str(directory), "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"])
    assert left.value.code == exit_codes.USAGE
