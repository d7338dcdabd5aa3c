"""The card: is it there, is there room, and does it swallow the data without long pauses."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from edge.config import Recording
from edge.preflight.check import Check, Outcome

MIB = 1024 * 1024
NOMINAL_MIB_S = 5.0
"""What the payload writes, uncompressed, with room to spare."""
PROBE_BLOCKS = 24
WORST_BLOCK_S = 2.0
"""The queue bridges 7 s; a card that pauses this long within 96 MiB will reach that in the field."""


@dataclass(frozen=True, slots=True)
class WriteSpeed:
    """Result of a write probe. worst_block_s: the slowest 4 MiB including its flush to the card."""

    mib_s: float
    worst_block_s: float


def check_disk(config: Recording) -> list[Check]:
    """Folder, space and speed of the place that recordings go to."""
    folder = Path(config.folder).expanduser()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        speed = probe(folder)
    except OSError as error:
        advice = "check that the card is in, mounted and writable for this user (ls -ld, mount)"
        return [Check("recordings", Outcome.BAD, f"cannot write to {folder}: {error.strerror}", advice)]
    return [_mount(folder, config.require_mount), _space(folder, config), _speed(speed)]


def probe(folder: Path) -> WriteSpeed:
    """Write and flush 96 MiB in blocks of 4 MiB. Leaves nothing behind. OSError when the folder cannot be written."""
    block = os.urandom(4 * MIB)
    slowest_s, begin_s = 0.0, time.monotonic()
    with tempfile.TemporaryFile(dir=folder) as file:
        for _ in range(PROBE_BLOCKS):
            block_s = time.monotonic()
            file.write(block)
            file.flush()
            os.fdatasync(file.fileno())
            slowest_s = max(slowest_s, time.monotonic() - block_s)
    return WriteSpeed(PROBE_BLOCKS * 4 / (time.monotonic() - begin_s), slowest_s)


def _mount(folder: Path, required: bool) -> Check:
    mount = next(path for path in (folder.resolve(), *folder.resolve().parents) if path.is_mount())
    own = mount != Path("/")
    found = f"{folder} is on {mount}" if own else f"{folder} is on the system's own disk"
    if own or not required:
        return Check("card", Outcome.GOOD, found)
    return Check("card", Outcome.BAD, found, "mount the card, or set recording.require_mount = false")


def _space(folder: Path, config: Recording) -> Check:
    usage = shutil.disk_usage(folder)
    floor = max(config.min_free_mib * MIB, usage.total * config.min_free_percent / 100.0)
    hours = (usage.free - floor) / (NOMINAL_MIB_S * MIB) / 3600.0
    found = f"{usage.free / 1024**3:.0f} GiB free, about {max(hours, 0.0):.1f} h of recording"
    if hours <= 0.0:
        return Check("space", Outcome.BAD, found, "free some space: recording refuses to start below its reserve")
    if hours < 1.0:
        return Check("space", Outcome.WARNING, found, "copy old sessions off the card before a long walk")
    return Check("space", Outcome.GOOD, found)


def _speed(speed: WriteSpeed) -> Check:
    found = f"{speed.mib_s:.0f} MiB/s, slowest 4 MiB took {speed.worst_block_s * 1e3:.0f} ms"
    if speed.mib_s < 2.0 * NOMINAL_MIB_S:
        return Check("card speed", Outcome.BAD, found, f"use a card that keeps {2 * NOMINAL_MIB_S:.0f} MiB/s or more")
    if speed.worst_block_s > WORST_BLOCK_S:
        advice = "format the card (ext4), or use a better one: long pauses cost data when they last over 7 s"
        return Check("card speed", Outcome.WARNING, found, advice)
    return Check("card speed", Outcome.GOOD, found)
