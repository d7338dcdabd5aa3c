"""The connection over a real socket, with a recorder that speaks the protocol."""

import asyncio
import contextlib

import pytest

from edge.control.messages import Request
from tests.ui.fake_recorder import FakeRecorder
from tests.waiting import PATIENCE_S
from ui import connection as connection_module
from ui.connection import SocketConnection
from ui.messages import Connected, ConnectionLost, Replied, StatusArrived


@pytest.fixture(autouse=True)
def quick_retries(monkeypatch):
    monkeypatch.setattr(connection_module, "FIRST_WAIT_S", 0.01)
    monkeypatch.setattr(connection_module, "LONGEST_WAIT_S", 0.02)


@contextlib.asynccontextmanager
async def running(path):
    connection, inbox = SocketConnection(path), asyncio.Queue()
    task = asyncio.create_task(connection.run(inbox.put_nowait))
    try:
        yield connection, inbox
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


async def until(inbox, kind):
    async def find():
        while not isinstance(message := await inbox.get(), kind):
            pass
        return message

    return await asyncio.wait_for(find(), PATIENCE_S)


async def test_it_subscribes_and_posts_statuses_and_replies(tmp_path):
    recorder = FakeRecorder(period_s=0.02)
    async with recorder.serving(tmp_path / "s"), running(tmp_path / "s") as (connection, inbox):
        await until(inbox, Connected)
        assert (await until(inbox, StatusArrived)).status.state == "idle"
        assert connection.send(Request("start", id=7))
        reply = await until(inbox, Replied)
        while reply.reply.id != 7:
            reply = await until(inbox, Replied)
        assert reply.reply.ok
        while (await until(inbox, StatusArrived)).status.state != "recording":
            pass
    assert [request.command for request in recorder.heard] == ["hello", "subscribe", "start"]


async def test_it_comes_back_when_the_recorder_does(tmp_path):
    path = tmp_path / "s"
    async with running(path) as (connection, inbox):
        lost = await until(inbox, ConnectionLost)
        assert "not running" in lost.problem
        assert not connection.send(Request("start"))
        for _ in range(2):
            async with FakeRecorder(period_s=0.02).serving(path):
                await until(inbox, Connected)
                await until(inbox, StatusArrived)
            await until(inbox, ConnectionLost)
        assert not connection.send(Request("start"))


@pytest.mark.parametrize(
    "line",
    [
        b"what?\n",
        b'{"type":"status"}\n',
        b'{"type":"reply","id":1,"ok":true,"version":99}\n',
        b"x" * (2 << 20),
        b'{"type":"request","command":"hello"}\n',
    ],
)
async def test_garbage_never_ends_it(tmp_path, line):
    async def babble(_, writer):
        writer.write(line)
        writer.close()

    server = await asyncio.start_unix_server(babble, tmp_path / "s")
    async with running(tmp_path / "s") as (_, inbox):
        for _ in range(2):
            await until(inbox, ConnectionLost)
        server.close()
