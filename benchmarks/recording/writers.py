"""The same messages written by this recorder's file class, by plain `mcap` and by `foxglove-sdk`, each in a process."""

from __future__ import annotations

import multiprocessing
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeAlias

import foxglove
from foxglove.mcap import MCAPWriteOptions
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from edge.config import Topics
from edge.recording.disk import Disk
from edge.recording.split import SplitFile
from edge.ros.schemas import schema_text
from edge.ros.topics import Channel, channels, tf_static_channel

CHUNK_BYTES = 1 << 20
ROUND_NS = 50_000_000
"""The recorder's writer wakes this often; all writers are paced alike."""
SECOND_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Recorded:
    """One message of a recording, byte for byte."""

    topic: str
    log_ns: int
    publish_ns: int
    sequence: int
    data: bytes


@dataclass(frozen=True, slots=True)
class WriterCost:
    """CPU seconds per recorded second, of all runs; `paced` is less what the pacing itself costs."""

    writer: str
    at_once: tuple[float, ...]
    paced: tuple[float, ...]

    @property
    def at_once_cores(self) -> float:
        return statistics.median(self.at_once)

    @property
    def paced_cores(self) -> float:
        return statistics.median(self.paced)


Write: TypeAlias = Callable[[Recorded], None]


def capture(folder: Path, seconds: float) -> list[Recorded]:
    """The first messages of a session in the order in which they were written."""
    taken: list[Recorded] = []
    for path in sorted(folder.glob("*.mcap")):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                if taken and message.log_time - taken[0].log_ns > seconds * SECOND_NS:
                    return taken
                taken.append(
                    Recorded(channel.topic, message.log_time, message.publish_time, message.sequence, message.data)
                )
    return taken


def compare(folder: Path, recorded: Sequence[Recorded], runs: int, paced_s: float) -> list[WriterCost]:
    """Every writer in turn, `runs` times, so that what else the machine does meets all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    at_once: dict[str, list[float]] = {name: [] for name in WRITERS}
    paced: dict[str, list[float]] = {name: [] for name in WRITERS}
    short = [one for one in recorded if one.log_ns - recorded[0].log_ns < paced_s * SECOND_NS]
    for _ in range(runs):
        for name in WRITERS:
            at_once[name].append(_cost(name, folder, recorded, pace=False))
        if paced_s > 0:
            pacing = _cost("nothing", folder, short, pace=True)
            for name in WRITERS:
                paced[name].append(_cost(name, folder, short, pace=True) - pacing)
    return [WriterCost(name, tuple(at_once[name]), tuple(paced[name])) for name in WRITERS]


def _cost(name: str, folder: Path, recorded: Sequence[Recorded], pace: bool) -> float:
    context = multiprocessing.get_context("fork")  # the messages go along without being copied
    ours, theirs = context.Pipe(duplex=False)
    child = context.Process(target=_child, args=(name, folder, recorded, pace, theirs))
    child.start()
    spent_s = float(ours.recv())
    child.join()
    return spent_s * SECOND_NS / (recorded[-1].log_ns - recorded[0].log_ns)


def _child(name: str, folder: Path, recorded: Sequence[Recorded], pace: bool, answer: Connection) -> None:
    path = folder / f"{name}.mcap"
    path.unlink(missing_ok=True)
    opened = _nothing if name == "nothing" else WRITERS[name]
    start_s = time.process_time()
    with opened(path) as write:
        (_paced if pace else _at_once)(recorded, write)
    spent_s = time.process_time() - start_s
    if name != "nothing":
        _check(path, len(recorded))
        path.unlink()
    answer.send(spent_s)


def _at_once(recorded: Sequence[Recorded], write: Write) -> None:
    for one in recorded:
        write(one)


def _paced(recorded: Sequence[Recorded], write: Write) -> None:
    """In batches of 50 ms of recorded time, each when its time has come."""
    began_ns, first_ns = time.monotonic_ns(), recorded[0].log_ns
    due_ns = 0
    for one in recorded:
        if one.log_ns - first_ns > due_ns:
            due_ns += ROUND_NS * -(-(one.log_ns - first_ns - due_ns) // ROUND_NS)
            time.sleep(max(0, began_ns + due_ns - time.monotonic_ns()) / 1e9)
        write(one)


def _check(path: Path, messages: int) -> None:
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    found = summary.statistics.message_count if summary and summary.statistics else 0
    if found != messages:
        raise RuntimeError(f"{path}: {found} of {messages} messages")


def _all_channels() -> list[Channel]:
    topics = Topics()
    return [*{channel.topic: channel for channel in channels(topics).values()}.values(), tf_static_channel(topics)]


@contextmanager
def _nothing(path: Path) -> Iterator[Write]:
    yield lambda one: None


@contextmanager
def _mapforest(path: Path) -> Iterator[Write]:
    """As in a session: own chunks, spans by topic, flush and fdatasync every second of recorded time."""
    split = SplitFile(Disk(), path, CompressionType.NONE, CHUNK_BYTES)
    split.begin({}, _all_channels())
    synced_ns = 0

    def write(one: Recorded) -> None:
        nonlocal synced_ns
        split.write(one.topic, one.log_ns, one.publish_ns, one.sequence, one.data)
        if one.log_ns - synced_ns >= SECOND_NS:
            split.sync()
            synced_ns = one.log_ns

    yield write
    split.finish(b"{}")
    split.active.rename(path)


@contextmanager
def _mcap(path: Path) -> Iterator[Write]:
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.NONE)
        writer.start(profile="ros2", library="benchmark")
        ids = {}
        for channel in _all_channels():
            schema = writer.register_schema(channel.type_name, "ros2msg", schema_text(channel.type_name))
            ids[channel.topic] = writer.register_channel(channel.topic, "cdr", schema)
        yield lambda one: writer.add_message(ids[one.topic], one.log_ns, one.data, one.publish_ns, one.sequence)
        writer.finish()


@contextmanager
def _foxglove(path: Path) -> Iterator[Write]:
    context = foxglove.Context()
    options = MCAPWriteOptions(compression=None, chunk_size=CHUNK_BYTES, profile="ros2")
    writer = foxglove.open_mcap(path, context=context, writer_options=options)
    logs = {}
    for one in _all_channels():
        schema = foxglove.Schema(name=one.type_name, encoding="ros2msg", data=schema_text(one.type_name))
        logs[one.topic] = foxglove.Channel(one.topic, schema=schema, message_encoding="cdr", context=context).log
    yield lambda one: logs[one.topic](one.data, log_time=one.log_ns)
    writer.close()


WRITERS = {"mapforest": _mapforest, "mcap": _mcap, "foxglove-sdk": _foxglove}
"""Name -> opens a file and gives what writes a message into it."""
