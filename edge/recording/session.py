"""One session being written."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from threading import Lock, Thread

import msgspec

from edge import toml_table
from edge.config import Config
from edge.errors import RecordingError
from edge.recording.account import RecordingStatus, Repair, SessionAbout, SessionResult, TopicDrops, Verdict
from edge.recording.anchor import Anchor
from edge.recording.bag import counts_by_topic
from edge.recording.calibration import load_calibration
from edge.recording.disk import Disk, floor_bytes
from edge.recording.folder import SessionRecord, session_folder, set_verdict, utc_text, write_session
from edge.recording.messages import Recordable
from edge.recording.queue import RecordQueue
from edge.recording.repair import repair_leftovers
from edge.recording.splits import Splits, disk_problem
from edge.recording.summary import Tally, drops_by_topic
from edge.recording.writer import SessionWriter
from edge.ros.encode import encode_transforms
from edge.ros.topics import channels, tf_static_channel

__all__ = [
    "RecordingStatus",
    "Repair",
    "SessionAbout",
    "SessionRecorder",
    "SessionResult",
    "TopicDrops",
    "Verdict",
    "repair_leftovers",
    "session_folder",
    "set_verdict",
]
_log = logging.getLogger(__name__)

START_ROOM_BYTES = 4 << 20
"""Above the reserve. A session that ended at the reserve gives 2 MiB back: that must not let the next one begin."""


class SessionRecorder:
    """Writes one session: `offer` from any thread, one writer thread, one thread that finishes splits."""

    def __init__(
        self,
        folder: Path,
        about: SessionAbout,
        config: Config,
        anchor: Anchor,
        *,
        disk: Disk | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """folder: the session's own folder, from `session_folder`; it does not exist yet."""
        self._folder = folder
        self._about = about
        self._config = config
        self._anchor = anchor
        self._disk = disk or Disk()
        self._clock = clock
        self._limits = config.recording
        self._channels = channels(config.topics)
        self._queue = RecordQueue(self._limits.queue_mib << 20, self._limits.reserve_percent)
        self._tally = Tally(anchor, about)
        self._calibration = load_calibration(config.calibration)
        self._config_toml = about.config_toml or toml_table.render(msgspec.to_builtins(config))
        self._stopping = Lock()
        self._result: SessionResult | None = None
        self._ended_ns = 0
        self._splits: Splits | None = None
        self._writer: SessionWriter | None = None
        self._thread: Thread | None = None

    def start(self) -> None:
        """Make the folder, open the first split, start to write. RecordingError when the disk refuses or is full."""
        self._check_place()
        try:
            self._disk.make_folder(self._folder)
            self._open()
        except FileExistsError as error:
            raise RecordingError(f"{self._folder}: exists already; every session needs a folder of its own") from error
        except OSError as error:
            self._undo()
            raise RecordingError(disk_problem(self._folder, error)) from error
        self._thread = Thread(target=self._run, name="recorder-writer", daemon=True)
        self._thread.start()

    def offer(self, message: Recordable) -> None:
        """Take a message off the caller's hands. Any thread; never blocks and never raises."""
        if type(message) in self._channels:
            self._queue.put(message)
        else:
            _log.error("%s cannot be recorded", type(message).__name__)

    def status(self) -> RecordingStatus:
        """Any thread, after `start`."""
        writer, splits = self._parts()
        return RecordingStatus(
            session=self._folder.name,
            folder=str(self._folder),
            elapsed_s=(self._clock() - self._anchor.monotonic_ns) / 1e9,
            bytes_written=splits.bytes_written,
            messages=splits.messages,
            dropped=self._dropped(),
            queue_fill=self._queue.fill(),
            flush_ms=writer.flush_ms,
            flush_worst_ms=self._tally.flush_worst_ms,
            split=splits.number,
            marks=len(self._tally.marks),
            last_progress_ns=writer.last_progress_ns,
            disk_free_bytes=writer.free_bytes,
            ended=writer.ended,
            error=writer.error or splits.background.error,
        )

    def stop(self, reason: str) -> SessionResult:
        """Write what is queued, finish the splits and the files beside them. Idempotent, never raises."""
        writer, splits = self._parts()
        with self._stopping:
            if self._result is None:
                writer.stop_reason = reason
                self._queue.close()
                if self._thread is not None:
                    self._thread.join()
                self._result = self._account(writer, splits)
            return self._result

    def _check_place(self) -> None:
        recordings = self._folder.parent
        if self._limits.require_mount and not self._disk.on_own_mount(recordings):
            raise RecordingError(
                f"{recordings}: no card is mounted there; insert it, or set recording.require_mount = false"
            )
        existing = next(place for place in (recordings, *recordings.absolute().parents) if place.exists())
        space = self._disk.space(existing)
        floor = floor_bytes(space, self._limits.min_free_mib, self._limits.min_free_percent)
        if space.free_bytes < floor + START_ROOM_BYTES:
            raise RecordingError(
                f"{recordings}: {space.free_bytes >> 20} MiB free, {floor >> 20} MiB must stay free; copy recordings "
                "off the card and delete them there, or lower recording.min_free_mib and recording.min_free_percent"
            )

    def _open(self) -> None:
        static = tf_static_channel(self._config.topics)
        splits = self._splits = Splits(
            self._disk,
            self._folder,
            self._limits,
            channels=(*self._channels.values(), static),
            opening=self._session_record,
            static=lambda stamp_ns: (static, encode_transforms(self._calibration.transforms, stamp_ns)),
        )
        splits.open(self._anchor.session_ns(self._clock()))
        splits.background.submit(partial(write_session, self._disk, self._folder, self._record(splits, "recording")))
        self._writer = SessionWriter(
            self._queue,
            splits,
            self._tally,
            channels=self._channels,
            anchor=self._anchor,
            limits=self._limits,
            folder=self._folder,
            disk=self._disk,
            clock=self._clock,
        )

    def _undo(self) -> None:
        """A start that failed leaves no thread and no empty folder behind."""
        if self._splits is not None:
            self._splits.abandon()
        with suppress(OSError):
            self._folder.rmdir()

    def _run(self) -> None:
        """Thread root."""
        writer, splits = self._parts()
        writer.run()
        self._ended_ns = self._clock()
        try:
            record = self._record(splits, "finished", writer.ended or writer.stop_reason, writer.error)
            write_session(self._disk, self._folder, record)
        except OSError as error:
            writer.error = writer.error or disk_problem(self._folder, error)

    def _parts(self) -> tuple[SessionWriter, Splits]:
        if self._writer is None or self._splits is None:
            raise RecordingError(f"session {self._folder.name} was not started")
        return self._writer, self._splits

    def _dropped(self) -> dict[str, TopicDrops]:
        return drops_by_topic(self._queue.drops(), self._channels, self._anchor)

    def _session_record(self, split: int) -> dict[str, str]:
        """The metadata record "session" at the head of each split."""
        return {
            "session": self._folder.name,
            "split": str(split),
            "software": self._about.software,
            "host": self._about.host,
            "mission": self._about.mission,
            "operator": self._about.operator,
            "carrier": self._about.carrier,
            "anchor_utc_ns": str(self._anchor.utc_ns),
            "anchor_monotonic_ns": str(self._anchor.monotonic_ns),
            "clock_synchronised": "true" if self._about.clock_synchronised else "false",
            "clock_source": self._about.clock_source,
            "config_toml": self._config_toml,
            "calibration_toml": self._calibration.text,
        }

    def _record(self, splits: Splits, state: str, reason: str = "", error: str = "") -> SessionRecord:
        tally, counts = self._tally, counts_by_topic(splits.finished)
        return SessionRecord(
            session=self._folder.name,
            state=state,
            about=self._about,
            started_utc=utc_text(self._anchor.utc_ns),
            anchor_utc_ns=self._anchor.utc_ns,
            anchor_monotonic_ns=self._anchor.monotonic_ns,
            reason=reason,
            error=error,
            duration_s=(self._clock() - self._anchor.monotonic_ns) / 1e9,
            bytes_written=sum(split.size_bytes for split in tuple(splits.finished)),
            messages=sum(counts.values()),
            counts=counts,
            dropped=self._dropped(),
            not_kept=splits.messages - sum(counts.values()) if state == "finished" else 0,
            splits=tuple(splits.finished),
            gnss_quality=dict(tally.gnss_quality),
            events=dict(tally.events),
            marks=tuple(tally.marks),
            clock=tally.clock(),
            flush_worst_ms=tally.flush_worst_ms,
            config_toml=self._config_toml,
            calibration_toml=self._calibration.text,
        )

    def _account(self, writer: SessionWriter, splits: Splits) -> SessionResult:
        counts = counts_by_topic(splits.finished)
        return SessionResult(
            session=self._folder.name,
            folder=self._folder,
            reason=writer.ended or writer.stop_reason,
            error=writer.error,
            duration_s=(self._ended_ns - self._anchor.monotonic_ns) / 1e9,
            bytes_written=sum(split.size_bytes for split in splits.finished),
            messages=sum(counts.values()),
            counts=counts,
            dropped=self._dropped(),
            splits=tuple(split.file for split in splits.finished),
            not_kept=splits.messages - sum(counts.values()),
        )
