"""The control socket from both ends: the protocol, and clients that misbehave."""

import contextlib
import json
import os
import socket
import stat
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from edge.control.client import ControlClient
from edge.control.codec import REQUEST_LIMIT
from edge.control.messages import Host, Reply, Request, Status
from edge.errors import ControlError
from edge.service.control_server import CLIENT_LIMIT, ControlServer
from tests.waiting import PATIENCE_S, wait_for

HOST = Host(
    cpu_percent=1.0,
    memory_percent=2.0,
    temperature_c=None,
    throttled=False,
    disk_free_bytes=3,
    disk_remaining_s=None,
    battery_remaining_s=None,
    queue_fill=0.0,
    clock_synchronised=True,
    clock_source="test",
)


def status(stamp_ns: int = 0, problem: str = "") -> Status:
    return Status(stamp_ns=stamp_ns, state="idle", sensors=(), host=HOST, problems=(problem,))


class FakeCommands:
    """Answers every request and remembers it; `hold` keeps `stop` waiting."""

    def __init__(self) -> None:
        self.requests: list[Request] = []
        self.hold = threading.Event()
        self.hold.set()

    def handle(self, request: Request, receive_ns: int) -> Reply:
        self.requests.append(request)
        if request.command == "stop":
            assert self.hold.wait(PATIENCE_S)
        if request.command == "validate":
            raise ControlError("nothing to validate") if request.session else ZeroDivisionError
        if request.command == "mark" and not request.text:
            return Reply(request.id, ok=False, error="a mark needs a text")
        return Reply(request.id, ok=True, session="s1")

    def status(self) -> Status:
        return status(7)


@pytest.fixture
def commands() -> FakeCommands:
    return FakeCommands()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run" / "control.sock"


@pytest.fixture
def server(path: Path, commands: FakeCommands) -> Iterator[ControlServer]:
    serving = ControlServer(path, commands, software="test 1")
    serving.start()
    yield serving
    commands.hold.set()
    serving.stop()


@pytest.fixture
def client(server: ControlServer, path: Path) -> Iterator[ControlClient]:
    with ControlClient(path) as connected:
        yield connected


def raw(path: Path) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.settimeout(PATIENCE_S)
    connection.connect(str(path))
    return connection


def read_line(connection: socket.socket) -> dict:
    data = b""
    while not data.endswith(b"\n"):
        data += connection.recv(1)
    return json.loads(data)


def test_a_request_gets_its_reply(client: ControlClient, commands: FakeCommands) -> None:
    reply = client.request(Request("start", mission="plot 7"))
    assert (reply.ok, reply.session) == (True, "s1")
    assert commands.requests[0].mission == "plot 7"


def test_a_refusal_is_raised_with_its_reason(client: ControlClient) -> None:
    with pytest.raises(ControlError, match="a mark needs a text"):
        client.request(Request("mark"))
    assert client.request(Request("mark", text="here")).ok


def test_an_error_in_a_command_is_a_refusal_and_the_server_lives_on(client: ControlClient) -> None:
    with pytest.raises(ControlError, match="nothing to validate"):
        client.request(Request("validate", session="s"))
    with pytest.raises(ControlError, match="validate failed inside the recorder"):
        client.request(Request("validate"))
    assert client.status().stamp_ns == 7


def test_the_status_is_told(client: ControlClient) -> None:
    assert client.status() == status(7)
    assert client.status() == status(7)


def test_subscribers_get_states_and_a_slow_one_the_newest(
    client: ControlClient, server: ControlServer, path: Path
) -> None:
    states = client.subscribe()
    assert next(states).stamp_ns == 7
    for stamp in range(100, 150):
        server.publish(status(stamp))
    with ControlClient(path) as other:
        other.status()  # the server works in order: everything published before is on its way
    assert next(states).stamp_ns == 149


def test_states_keep_coming_while_a_command_takes_long(
    client: ControlClient, server: ControlServer, path: Path, commands: FakeCommands
) -> None:
    commands.hold.clear()
    with raw(path) as stopping:
        stopping.sendall(b'{"type":"request","command":"stop","id":5}\n')
        wait_for(lambda: commands.requests)
        assert client.status().stamp_ns == 7
        commands.hold.set()
        assert read_line(stopping)["id"] == 5


def test_only_owner_and_group_may_use_the_socket(server: ControlServer, path: Path) -> None:
    assert stat.S_IMODE(path.stat().st_mode) == 0o660
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


def test_another_version_is_refused_in_words(server: ControlServer, path: Path) -> None:
    with raw(path) as old:
        old.sendall(b'{"type":"request","command":"reverse","id":9,"version":77}\n')
        reply = read_line(old)
    assert (reply["id"], reply["ok"], reply["version"]) == (9, False, 1)
    assert "77" in reply["error"]


def test_a_recorder_of_another_version_is_named(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as future:
        future.bind(str(path))
        future.listen()

        def answer() -> None:
            connection, _ = future.accept()
            with connection:
                connection.recv(4096)
                connection.sendall(b'{"type":"reply","id":1,"ok":false,"version":2,"software":"mapforest 9"}\n')

        thread = threading.Thread(target=answer)
        thread.start()
        with pytest.raises(ControlError, match=r"mapforest 9.* speaks version 2 .* restart the recorder"):
            ControlClient(path).connect()
        thread.join(PATIENCE_S)


def test_no_recorder_no_permission_and_a_silent_one_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(ControlError, match=r"not running .*systemctl start"):
        ControlClient(tmp_path / "nothing").status()
    silent = tmp_path / "silent"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listening:
        listening.bind(str(silent))
        listening.listen()
        with pytest.raises(ControlError, match=r"did not answer 'hello' within 0.05 s"):
            ControlClient(silent, timeout_s=0.05).status()


@pytest.mark.skipif(os.getuid() == 0, reason="root may use every socket")
def test_no_permission_is_told(server: ControlServer, path: Path) -> None:
    path.chmod(0)
    with pytest.raises(ControlError, match="no permission"):
        ControlClient(path).status()


def test_a_recorder_that_goes_away_is_told(client: ControlClient, server: ControlServer) -> None:
    states = client.subscribe()
    next(states)
    server.stop()
    with pytest.raises(ControlError, match="hung up"):
        next(states)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(garbage=st.binary(max_size=400) | st.text(max_size=100).map(lambda text: json.dumps({"type": text}).encode()))
def test_garbage_is_refused_and_disturbs_nobody(client: ControlClient, path: Path, garbage: bytes) -> None:
    with raw(path) as rude, contextlib.suppress(ConnectionError):
        rude.sendall(garbage + b"\n")
        assert read_line(rude)["ok"] is False
    assert client.status().stamp_ns == 7


def test_a_line_without_end_is_cut_off(client: ControlClient, path: Path) -> None:
    with raw(path) as rude, contextlib.suppress(ConnectionError):
        rude.sendall(b"x" * (3 * REQUEST_LIMIT))
        while rude.recv(65536):
            continue
    assert client.status().stamp_ns == 7


def test_a_client_that_does_not_read_is_dropped(client: ControlClient, server: ControlServer, path: Path) -> None:
    with raw(path) as slow:
        slow.sendall(b'{"type":"request","command":"subscribe"}\n')
        read_line(slow)
        wait_for(lambda: server._subscribers)
        big = status(problem="x" * 100_000)
        for _ in range(20):
            server.publish(big)
        wait_for(lambda: not server._subscribers)
        assert client.status().stamp_ns == 7


def test_one_client_too_many_is_refused(client: ControlClient, path: Path) -> None:
    client.status()
    with contextlib.ExitStack() as stack:
        crowd = [stack.enter_context(raw(path)) for _ in range(CLIENT_LIMIT)]
        assert "more than" in read_line(crowd[-1])["error"]
        assert client.status().stamp_ns == 7


def test_a_stale_socket_is_replaced_a_live_one_and_a_file_are_not(path: Path, commands: FakeCommands) -> None:
    path.parent.mkdir()
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as dead:
        dead.bind(str(path))
    first = ControlServer(path, commands)
    first.start()
    try:
        with pytest.raises(ControlError, match="another recorder is running"):
            ControlServer(path, commands).start()
    finally:
        first.stop()
    assert not path.exists()
    path.write_text("a file")
    with pytest.raises(ControlError, match="is in the way"):
        ControlServer(path, commands).start()
    assert path.read_text() == "a file"


def test_an_unknown_group_is_named(path: Path, commands: FakeCommands) -> None:
    with pytest.raises(ControlError, match=r"control.group: no group 'nosuchgroup'"):
        ControlServer(path, commands, group="nosuchgroup").start()
    assert not path.exists()


def test_a_stopped_server_leaves_the_socket_of_its_successor(path: Path, commands: FakeCommands) -> None:
    first = ControlServer(path, commands)
    first.start()
    path.unlink()
    second = ControlServer(path, commands)
    second.start()
    first.stop()
    with ControlClient(path) as client:
        assert client.status().stamp_ns == 7
    second.stop()
