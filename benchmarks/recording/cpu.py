"""CPU and memory of a process, as the kernel accounts them in /proc."""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, slots=True)
class Usage:
    """CPU seconds so far: of the process with its dead threads, and of its living threads by their names."""

    process_s: float
    threads_s: Counter[str]


def usage(pid: int) -> Usage:
    """utime + stime of the process (ticks of 10 ms), run time of each thread (nanoseconds)."""
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    threads: Counter[str] = Counter()
    for task in Path(f"/proc/{pid}/task").iterdir():
        with contextlib.suppress(OSError):  # it has just ended
            name = "main" if task.name == str(pid) else (task / "comm").read_text().strip()
            threads[name] += int((task / "schedstat").read_text().split()[0]) / 1e9
    return Usage((int(words[11]) + int(words[12])) * TICK_S, threads)


def niceness(pid: int) -> int:
    """Priority the process runs at; -20 is the highest."""
    return os.getpriority(os.PRIO_PROCESS, pid)


def rss_mib(pid: int) -> float:
    """Resident memory."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return 0.0


def load_average() -> str:
    """Of one, five and fifteen minutes."""
    return " ".join(f"{value:.2f}" for value in os.getloadavg())
