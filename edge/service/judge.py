"""Validation of a finished session in a process of its own, so that the next recording is not disturbed."""

from __future__ import annotations

import contextlib
import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import psutil

import edge
from edge import toml_table
from edge.config import check
from edge.control.messages import Verdict
from edge.errors import EdgeError
from edge.recording import session as recording

log = logging.getLogger(__name__)

_PROGRAM_FOLDER = Path(edge.__file__).parents[1]
_NICENESS = 10
_CLOSE_S = 2.0


class Judge:
    """Validates one session after the other; `verdict` is the newest word."""

    def __init__(self, config_toml: str, command: Callable[[Path], Sequence[str]] | None = None) -> None:
        """config_toml: the configuration in effect; the file may have changed since. command: the program that judges
        a folder by the configuration on its standard input, and prints a Verdict as JSON."""
        self.verdict: Verdict | None = None
        self._config_toml = config_toml
        self._command = command or _own_command
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._closed = False

    def submit(self, folder: Path) -> None:
        """Judge a session. Returns at once; the verdict says `running` until it is there. Nothing after `close`."""
        if self._closed:
            return
        self.verdict = Verdict(folder.name, "", running=True)
        threading.Thread(target=self._run, args=(folder,), name="judge", daemon=True).start()

    def close(self) -> None:
        """Leave off, and wait a moment for that. Idempotent."""
        self._closed = True
        process = self._process
        if process is not None:
            process.terminate()
        if self._lock.acquire(timeout=_CLOSE_S):
            self._lock.release()

    def _run(self, folder: Path) -> None:
        """Thread root."""
        with self._lock:  # one after the other
            if self._closed:
                return
            verdict = self._judge(folder)
            if self.verdict is None or self.verdict.session == folder.name:
                self.verdict = Verdict(folder.name, verdict.verdict, verdict.reasons)
        log.info("session %s: %s %s", folder.name, verdict.verdict, "; ".join(verdict.reasons))

    def _judge(self, folder: Path) -> recording.Verdict:
        try:
            output = self._ask(folder)
            verdict = msgspec.json.decode(output, type=recording.Verdict)
            recording.set_verdict(folder, verdict)
        except (OSError, EdgeError, msgspec.MsgspecError) as error:
            return _unjudged(folder, str(error))
        return verdict

    def _ask(self, folder: Path) -> bytes:
        process = subprocess.Popen(
            self._command(folder), stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=_PROGRAM_FOLDER
        )
        with process:
            self._process = process
            if self._closed:
                process.terminate()
            output, _ = process.communicate(self._config_toml.encode())
            self._process = None
        if process.returncode != 0:
            raise OSError(f"the validator ended with code {process.returncode}; see the recorder's log")
        return output


def _own_command(folder: Path) -> list[str]:
    return [sys.executable, "-m", "edge.service.judge", str(folder.absolute())]


def _unjudged(folder: Path, why: str) -> recording.Verdict:
    return recording.Verdict("WARN", (f"not validated: {why}; run `mapforest validate {folder}`",))


def main(folder: Path, config_toml: str) -> int:
    """The process: judge, and print the verdict as JSON."""
    # Imported here: the service itself never loads the validator.
    from edge.validation.validate import validate  # noqa: PLC0415

    os.nice(_NICENESS)
    with contextlib.suppress(psutil.Error, OSError):  # a sandbox may forbid it
        psutil.Process().ionice(psutil.IOPRIO_CLASS_IDLE)
    source = "the recorder's configuration"
    try:
        report = validate(folder, check(toml_table.parse(config_toml, source), source))
    except EdgeError as error:
        log.error("%s", error)  # noqa: TRY400 - it is a sentence for people
        return 1
    sys.stdout.buffer.write(msgspec.json.encode(recording.Verdict(report.verdict, tuple(report.reasons))))
    return 0


if __name__ == "__main__":
    logging.basicConfig(level=logging.WARNING)
    sys.exit(main(Path(sys.argv[1]), sys.stdin.read()))
