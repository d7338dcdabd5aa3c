"""The operator's screen is killed, or its terminal goes away: the recorder does not care."""

import contextlib
import fcntl
import os
import shutil
import signal
import struct
import subprocess
import sys
import termios

import pytest

from tests.reliability.chain import ROOT, Chain
from tests.reliability.session import Session
from tests.waiting import PATIENCE_S, wait_for

pytestmark = [pytest.mark.slow, pytest.mark.skipif(shutil.which("setsid") is None, reason="no setsid here")]


class Screen:
    """`mapforest tui` in a pseudo-terminal of its own."""

    def __init__(self, chain: Chain) -> None:
        self.shown = b""
        self._master, slave = os.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        os.set_blocking(self._master, False)
        # Its controlling terminal, as of a login: else nothing tells it that the line went dead.
        command = ["setsid", "--ctty", sys.executable, "-m", "edge.cli.main", "tui", "--config", str(chain.config)]
        environ = {**os.environ, "TERM": "xterm-256color"}
        self.process = subprocess.Popen(command, cwd=ROOT, env=environ, stdin=slave, stdout=slave, stderr=slave)
        os.close(slave)

    def shows(self, text: bytes) -> bool:
        """Whether this was drawn since the screen came up."""
        with contextlib.suppress(BlockingIOError):
            self.shown += os.read(self._master, 65536)
        return text in self.shown

    def press(self, key: bytes) -> None:
        os.write(self._master, key)

    def hang_up(self) -> None:
        """As a lost SSH session does."""
        os.close(self._master)


@pytest.mark.parametrize("end", ["kill", "hang up"])
def test_a_screen_that_ends_stops_nothing(tmp_path, figures, end):
    with Chain(tmp_path) as chain:
        chain.until_delivering()
        screen = Screen(chain)
        wait_for(lambda: screen.shows(b"Press SPACE to start"))
        screen.press(b" ")
        wait_for(lambda: chain.status and chain.status.state == "recording")
        wait_for(lambda: screen.shows(b"Recording"))
        chain.until_more(10)
        if end == "kill":
            screen.process.send_signal(signal.SIGKILL)
            screen.process.wait()
            screen.hang_up()
        else:
            screen.hang_up()
            screen.process.wait(PATIENCE_S)
        chain.until_more(20)
        assert chain.status is not None
        assert chain.status.state == "recording"
        assert chain.status.recording is not None
        folder = chain.recordings / chain.status.recording.session
        again = Screen(chain)
        wait_for(lambda: again.shows(b"mission"))
        again.process.kill()
        again.process.wait()
        again.hang_up()
        chain.stop()
        verdict, reasons = chain.until_verdict()
    session = Session(folder)
    figures(f"nothing; {verdict} {reasons}")
    assert session.record["dropped"] == {}
    assert session.doubled == session.partial == []
