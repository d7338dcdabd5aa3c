"""The recorder with a disk that can stall and a system clock that can step, as `FOLDER` says. Everything else is real.

`python -m tests.reliability.faulty_recorder FOLDER recorder --config FILE`: the next sync takes as many seconds as
`FOLDER/stall` says, which is removed then; `FOLDER/step` is the sum of the clock's steps so far, in ns.
"""

from __future__ import annotations

import struct
import sys
import threading
import time
from pathlib import Path

from drivers.livox import receive
from edge.cli.main import main
from edge.recording.disk import DiskFile


def stall(trigger: Path) -> None:
    """Make syncs of the disk wait on demand."""
    sync = DiskFile.sync

    def waiting(file: DiskFile) -> None:
        if trigger.exists():
            seconds = float(trigger.read_text())
            trigger.unlink()
            threading.Event().wait(seconds)
        sync(file)

    DiskFile.sync = waiting


class SteppedClock:
    """CLOCK_REALTIME as it would be after somebody set it, for this process and for the kernel's stamps in it."""

    size = receive._TIMESPEC.size

    def __init__(self, path: Path) -> None:
        self._path = path
        self._true_ns = time.time_ns
        self._steps: list[tuple[int, int]] = [(0, 0)]
        """When by the true clock, and the offset from then on, ns."""

    def start(self) -> None:
        time.time_ns = self.time_ns
        time.time = lambda: self.time_ns() / 1e9
        receive._TIMESPEC = self
        threading.Thread(target=self._watch, daemon=True).start()

    def time_ns(self) -> int:
        return self._true_ns() + self._steps[-1][1]

    def unpack(self, data: bytes) -> tuple[int, int]:
        """A kernel's stamp: of before the step if the datagram came before it."""
        seconds, nanoseconds = struct.unpack("@qq", data)
        true_ns = seconds * 1_000_000_000 + nanoseconds
        offset_ns = next(offset for at_ns, offset in reversed(self._steps) if at_ns <= true_ns)
        return divmod(true_ns + offset_ns, 1_000_000_000)

    def _watch(self) -> None:
        pause = threading.Event()
        while not pause.wait(0.02):
            text = self._path.read_text() if self._path.exists() else ""
            if text and int(text) != self._steps[-1][1]:
                self._steps.append((self._true_ns(), int(text)))


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    stall(folder / "stall")
    SteppedClock(folder / "step").start()
    sys.exit(main(sys.argv[2:]))
