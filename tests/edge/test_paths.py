"""Where recorder and clients meet."""

from pathlib import Path

from edge.config import Config, Control
from edge.paths import control_socket, find_control_socket


def test_the_configured_socket_comes_first() -> None:
    config = Config(control=Control(socket="/a/b.sock"))
    assert control_socket(config, {"RUNTIME_DIRECTORY": "/run/mapforest"}) == Path("/a/b.sock")
    assert find_control_socket(config, {}) == Path("/a/b.sock")


def test_then_the_runtime_directory_of_the_service_then_of_the_user() -> None:
    user = {"XDG_RUNTIME_DIR": "/run/user/1000"}
    assert control_socket(Config(), {"RUNTIME_DIRECTORY": "/run/m:/run/n", **user}) == Path("/run/m/control.sock")
    assert control_socket(Config(), user) == Path("/run/user/1000/mapforest/control.sock")
    assert control_socket(Config(), {}).parent.name.startswith("mapforest-")


def test_a_client_finds_the_system_service_when_the_user_runs_none(tmp_path: Path) -> None:
    system = tmp_path / "system"
    user = tmp_path / "mapforest"
    environ = {"XDG_RUNTIME_DIR": str(tmp_path)}
    for folder in (system, user):
        folder.mkdir()
    assert find_control_socket(Config(), environ, system) == user / "control.sock"
    (system / "control.sock").touch()
    assert find_control_socket(Config(), environ, system) == system / "control.sock"
    (user / "control.sock").touch()
    assert find_control_socket(Config(), environ, system) == user / "control.sock"
