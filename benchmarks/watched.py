"""A run of `mapforest process`, watched from outside: how far it was when, and how much memory it held."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec


@dataclass(frozen=True)
class Sample:
    """stages: how many are finished."""

    after_s: float
    stages: int
    memory_mb: float


@dataclass(frozen=True)
class Run:
    """facts: what the command printed."""

    took_s: float
    samples: list[Sample]
    facts: dict[str, Any]

    def of(self, stage: int) -> list[Sample]:
        """While that stage was being done."""
        return [sample for sample in self.samples if sample.stages == stage]

    def seconds(self, stage: int) -> float:
        """It took, to the period of the samples."""
        begun = [sample.after_s for sample in self.samples if sample.stages >= stage]
        ended = [sample.after_s for sample in self.samples if sample.stages > stage]
        return (ended[0] if ended else self.took_s) - begun[0] if begun else 0.0

    def most_mb(self, stage: int) -> float:
        """Resident."""
        return max((sample.memory_mb for sample in self.of(stage)), default=0.0)


def process(source: Path, output: Path, options: Sequence[str] = (), every_s: float = 1.0) -> Run:
    """Everything anew, in a process of its own."""
    command = [sys.executable, "-m", "edge.cli.main", "process", str(source), "--output", str(output), "--fresh"]
    state = output / "work" / "state.json"
    state.unlink(missing_ok=True)  # of an earlier run, whose stages are not those of this one
    begun_s = time.monotonic()
    running = subprocess.Popen([*command, *options, "--json"], stdout=subprocess.PIPE, text=True)
    samples = list(_watched(running, state, every_s))
    text, _ = running.communicate()
    return Run(time.monotonic() - begun_s, samples, msgspec.json.decode(text))


def _watched(running: subprocess.Popen[str], state: Path, every_s: float) -> Iterator[Sample]:
    begun_s = time.monotonic()
    while running.poll() is None:
        status = Path(f"/proc/{running.pid}/status")
        try:
            resident = status.read_text(encoding="ascii").split("VmRSS:")[1].split()[0]
            stages = len(msgspec.json.decode(state.read_bytes())["stages"]) if state.exists() else 0
        except (OSError, IndexError):
            break  # it ended between the two looks
        yield Sample(time.monotonic() - begun_s, stages, int(resident) / 1024.0)
        time.sleep(every_s)
