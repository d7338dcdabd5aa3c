"""The files of a session, one after the other. The next is open before the last is closed, so nothing waits."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from edge.config import Recording
from edge.errors import EdgeError
from edge.recording.background import Background
from edge.recording.bag import METADATA_YAML, SplitFacts, metadata_yaml, read_facts
from edge.recording.disk import Disk
from edge.recording.split import SplitFile, compression_type
from edge.recording.summary import Written
from edge.ros.topics import Channel

_log = logging.getLogger(__name__)
RESERVE_FILE = ".reserve"
_RESERVE_BYTES = 2 << 20
"""Given up when the disk is full, to make room for the indexes of the last split (about 200 kB for 1 GiB)."""


class Splits:
    """Written by one thread; finishing goes on in the background."""

    def __init__(
        self,
        disk: Disk,
        folder: Path,
        limits: Recording,
        *,
        channels: Sequence[Channel],
        opening: Callable[[int], dict[str, str]],
        static: Callable[[int], tuple[Channel, bytes]],
    ) -> None:
        """opening: the record `session` of a split by its number. static: what each split repeats, by its stamp."""
        self.finished: list[SplitFacts] = []
        self.background = Background("recorder-finisher")
        self.number = 0
        self._disk = disk
        self._folder = folder
        self._limits = limits
        self._channels = tuple({channel.topic: channel for channel in channels}.values())
        self._opening = opening
        self._static = static
        self._compression = compression_type(limits.compression)
        self.messages = 0
        self._counts: dict[str, int] = {}
        self._closed_bytes = 0
        self._start_ns = 0
        self._current: SplitFile | None = None

    @property
    def bytes_written(self) -> int:
        return self._closed_bytes + (self._current.size_bytes if self._current else 0)

    @property
    def current(self) -> SplitFile:
        assert self._current is not None, "open() comes first"
        return self._current

    def open(self, now_ns: int) -> None:
        """Open the first split. OSError when the disk refuses."""
        self._current = self._open(now_ns)
        self.background.submit(partial(self._disk.allocate, self._folder / RESERVE_FILE, _RESERVE_BYTES))
        self.background.submit(partial(self._disk.sync_folder, self._folder))

    def due(self, log_ns: int) -> bool:
        """Whether a message received at `log_ns` belongs into the next split."""
        full = self.current.size_bytes >= self._limits.split_mib << 20
        return full or log_ns - self._start_ns >= self._limits.split_s * 1e9

    def roll(self, now_ns: int, summary: bytes) -> None:
        """Go on in a new file; the old one is finished with `summary` in the background."""
        old = self.current
        self.number += 1
        self._current = self._open(now_ns)
        self._hand_over(old, summary)

    def write(self, topic: str, log_ns: int, publish_ns: int, data: bytes) -> None:
        """A message into the current split; its sequence number runs on from split to split."""
        self._append(self.current, topic, log_ns, publish_ns, data)

    def written(self) -> Written:
        """What went into the current split and into the session so far. Called by the thread that writes."""
        return Written(self._folder.name, dict(self.current.topics), dict(self._counts))

    def finish(self, summary: bytes) -> None:
        """Finish the last split and return when all are on the medium under their final names."""
        self._hand_over(self.current, summary)
        self._end()

    def abandon(self) -> None:
        """The disk refused: keep what is readable in the current split, and finish the others."""
        if self._current is not None:
            self.background.submit(partial(self._salvage, self._current))
        self._end()

    def _end(self) -> None:
        self._current = None
        self.background.join()
        self._disk.remove(self._folder / RESERVE_FILE)

    def _open(self, now_ns: int) -> SplitFile:
        path = self._folder / f"{self._folder.name}_{self.number}.mcap"
        split = SplitFile(self._disk, path, self._compression, self._limits.chunk_kib << 10)
        try:
            self._begin(split, now_ns)
        except OSError:
            split.close()
            self._disk.remove(split.active)
            raise
        self._start_ns = now_ns
        return split

    def _begin(self, split: SplitFile, now_ns: int) -> None:
        split.begin(self._opening(self.number), self._channels)
        channel, data = self._static(now_ns)
        self._append(split, channel.topic, now_ns, now_ns, data)
        split.flush()

    def _append(self, split: SplitFile, topic: str, log_ns: int, publish_ns: int, data: bytes) -> None:
        sequence = self._counts.get(topic, 0)
        split.write(topic, log_ns, publish_ns, sequence, data)
        self._counts[topic] = sequence + 1
        self.messages += 1

    def _hand_over(self, split: SplitFile, summary: bytes) -> None:
        self._closed_bytes += split.size_bytes
        self.background.submit(partial(self._finish, split, summary))

    def _finish(self, split: SplitFile, summary: bytes) -> None:
        try:
            facts = split.finish(summary)
        except OSError as error:
            self.background.error = disk_problem(split.path, error)
            _log.error("%s", self.background.error)
            self._salvage(split)
            return
        self._publish(split, facts)

    def _salvage(self, split: SplitFile) -> None:
        """Cut a file the disk refused to take in full after its last whole chunk, and end it properly."""
        from edge.recording.recover import finish_in_place  # noqa: PLC0415 - needed once in a blue moon

        try:
            split.close()
        except OSError as error:
            _log.warning("closing %s: %s", split.active, error)
        self._disk.remove(self._folder / RESERVE_FILE)
        try:
            finish_in_place(split.active)
            facts, _ = read_facts(split.active)
        except (OSError, EdgeError) as error:
            _log.warning("%s stays as it is until the next start: %s", split.active, error)
            return
        self._publish(split, SplitFacts(split.path.name, facts.start_ns, facts.end_ns, facts.size_bytes, facts.counts))

    def _publish(self, split: SplitFile, facts: SplitFacts) -> None:
        self._disk.rename(split.active, split.path)
        self.finished.append(facts)
        self._disk.replace(self._folder / METADATA_YAML, metadata_yaml(self.finished, self._channels))


def disk_problem(path: Path, error: OSError) -> str:
    """What happened to the disk at `path`, and what to do."""
    return (
        f"{path}: cannot be written: {error.strerror or error}; what was written before is kept. "
        "Check the card and its free space, then start a new recording"
    )
