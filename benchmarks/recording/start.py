"""From the start key to the first message on the disk."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

from mcap.exceptions import EndOfFile, McapError
from mcap.reader import NonSeekingReader

from benchmarks.recording.bench import recorder, wait_for_verdict
from benchmarks.recording.load import Load
from benchmarks.recording.payload import payload
from edge.control.messages import Request

POLL_S = 0.002
PATIENCE_S = 10.0
PAUSE_S = 2.0


@dataclass(frozen=True, slots=True)
class Start:
    """Seconds after the request was sent, by the client's clock.

    reply_s: the recorder said that it records. received_s: reception of the first sensor message in the file; it may
    lie before the key, for a message that was on its way from the socket to the queue then.
    disk_s: that message was read back from the file by another process, whose own fdatasync of it has returned.
    """

    reply_s: float
    received_s: float
    disk_s: float


def starts(folder: Path, load: Load, count: int) -> list[Start]:
    """Start and stop so many sessions with all sensors streaming."""
    measured = []
    with payload(load), recorder(folder, load) as bench:
        for _ in range(count):
            time.sleep(PAUSE_S)
            sent_ns, sent_utc_ns = time.monotonic_ns(), time.time_ns()
            session = Path(bench.client.request(Request("start", mission="bench")).folder)
            reply_ns = time.monotonic_ns()
            first_utc_ns, disk_ns = _first_on_disk(session)
            received_s = (first_utc_ns - sent_utc_ns) / 1e9
            measured.append(Start((reply_ns - sent_ns) / 1e9, received_s, (disk_ns - sent_ns) / 1e9))
            bench.client.request(Request("stop"))
            wait_for_verdict(bench.client)
            shutil.rmtree(session)
    return measured


def _first_on_disk(session: Path) -> tuple[int, int]:
    """(log time of the first sensor message, monotonic time at which it was on the medium)."""
    path = next(session.glob("*_0.mcap.active"))
    deadline_s = time.monotonic() + PATIENCE_S
    size = 0
    with path.open("rb") as stream:
        while time.monotonic() < deadline_s:
            if (now := os.fstat(stream.fileno()).st_size) > size:
                size = now
                stream.seek(0)
                log_time = _first_sensor_message(stream.read(size))
                if log_time is not None:
                    os.fdatasync(stream.fileno())
                    return log_time, time.monotonic_ns()
            time.sleep(POLL_S)
    raise RuntimeError(f"{path}: no message within {PATIENCE_S:.0f} s")


def _first_sensor_message(data: bytes) -> int | None:
    """Log time of the earliest message that is not the recorder's own."""
    found = []
    with contextlib.suppress(EndOfFile, McapError):  # the file is being written
        for _, channel, message in NonSeekingReader(io.BytesIO(data)).iter_messages(log_time_order=False):
            if channel.topic.startswith(("/livox", "/gnss", "/camera")):
                found.append(message.log_time)
    return min(found, default=None)
