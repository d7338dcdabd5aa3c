import errno
import subprocess
import sys
from types import SimpleNamespace

import pytest

from edge.cli import exit_codes, main
from edge.errors import EdgeError, UsageError


def command(run):
    return SimpleNamespace(HELP="does it\n\nexample: it", add_arguments=lambda parser: None, run=run)


@pytest.fixture
def only(monkeypatch):
    """Replaces every command's module by one that does as told."""

    def install(run):
        monkeypatch.setattr(main, "_load", lambda name: command(run))

    return install


def failing(error):
    def run(args):
        raise error

    return run


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (EdgeError("the card is out"), exit_codes.FAILED),
        (UsageError("a number is meant"), exit_codes.USAGE),
        (KeyboardInterrupt(), exit_codes.FAILED),
    ],
)
def test_errors_become_one_line_and_an_exit_code(only, capsys, error, code):
    only(failing(error))
    assert main.main(["status"]) == code
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    assert str(error) in told.err


def test_a_full_disk_is_told(only, capsys):
    only(failing(OSError(errno.ENOSPC, "No space left on device", "/data/0_1.tile")))
    assert main.main(["status"]) == exit_codes.FAILED
    assert capsys.readouterr().err == "mapforest: the disk is full (/data/0_1.tile): make room and run the same again\n"


@pytest.mark.parametrize("bug", [ZeroDivisionError("a bug"), OSError(errno.EIO, "Input/output error")])
def test_a_bug_is_not_hidden(only, bug):
    only(failing(bug))
    with pytest.raises(type(bug)):
        main.main(["status"])


@pytest.mark.parametrize("arguments", [[], ["nonsense"], ["status", "--nonsense"]])
def test_wrong_usage_is_2(arguments, capsys):
    with pytest.raises(SystemExit) as left:
        main.main(arguments)
    assert left.value.code == exit_codes.USAGE
    assert "usage" in capsys.readouterr().err


@pytest.mark.parametrize("name", main.COMMANDS)
def test_every_command_has_help_with_an_example(name, capsys):
    with pytest.raises(SystemExit) as left:
        main.main([name, "--help"])
    assert left.value.code == 0
    told = capsys.readouterr().out
    assert "example" in told
    assert "--json" in told


def test_the_list_of_commands_loads_none_of_them():
    program = "import sys; from edge.cli.main import main\ntry: main(['--help'])\nexcept SystemExit: pass\n"
    program += "print([m for m in sys.modules if m in ('numpy', 'numba', 'textual', 'edge.cli.demo')])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert all(name in done.stdout for name in main.COMMANDS)


def test_the_configuration_is_found_by_the_environment(monkeypatch, only):
    seen = []
    only(lambda args: seen.append(args.config) or 0)
    monkeypatch.setenv("MAPFOREST_CONFIG", "/somewhere/payload.toml")
    main.main(["status"])
    main.main(["status", "--config", "other.toml"])
    assert [str(path) for path in seen] == ["/somewhere/payload.toml", "other.toml"]
