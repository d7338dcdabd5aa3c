"""What a power cut left behind, put in order at the next start."""

from __future__ import annotations

import logging
from pathlib import Path

import msgspec

from edge.errors import EdgeError
from edge.recording.account import Repair
from edge.recording.bag import METADATA_YAML, SplitFacts, counts_by_topic, metadata_yaml, read_facts
from edge.recording.disk import Disk
from edge.recording.folder import SESSION_JSON, read_session, write_session
from edge.recording.split import ACTIVE_SUFFIX
from edge.recording.splits import RESERVE_FILE
from edge.ros.topics import Channel

_log = logging.getLogger(__name__)
DAMAGED_SUFFIX = ".damaged"


def repair_leftovers(recordings: Path) -> list[Repair]:
    """Finish what a power cut left open below `recordings`. At start-up, before any session.

    Each `*.mcap.active` is finished in place and renamed, `metadata.yaml` is made anew and `session.json` says
    "unclean". A file in which nothing can be read is renamed to `*.damaged`; nothing is ever deleted.
    """
    repairs: list[Repair] = []
    for folder in sorted(recordings.iterdir()) if recordings.is_dir() else ():
        if folder.is_dir() and (left := _left_open(folder)) is not None:
            try:
                repairs += [_repair(path) for path in left]
                _settle(folder)
            except OSError as error:
                _log.exception("%s: cannot be put in order", folder)
                repairs.append(Repair(folder.name, folder, "", 0, 0, f"{error}; check the card"))
    return repairs


def _left_open(folder: Path) -> list[Path] | None:
    """Open files of a session that was not ended; None when the session is in order."""
    active = sorted(folder.glob(f"*.mcap{ACTIVE_SUFFIX}"))
    if active:
        return active
    try:
        return [] if read_session(folder).state == "recording" else None
    except EdgeError:
        return None


def _repair(path: Path) -> Repair:
    from edge.recording.recover import finish_in_place  # noqa: PLC0415 - costs time at every start, needed rarely

    folder, final = path.parent, path.with_name(path.name.removesuffix(ACTIVE_SUFFIX))
    size = path.stat().st_size
    try:
        report = finish_in_place(path)
    except EdgeError as error:
        Disk().rename(path, path.with_name(final.name + DAMAGED_SUFFIX))
        return Repair(folder.name, folder, final.name, 0, size, str(error))
    Disk().rename(path, final)
    return Repair(folder.name, folder, final.name, report.messages, report.bytes_dropped)


def _settle(folder: Path) -> None:
    """`metadata.yaml` and `session.json` from the files that are there."""
    disk = Disk()
    disk.remove(folder / RESERVE_FILE)
    splits, channels = _survey(folder)
    if splits:
        disk.replace(folder / METADATA_YAML, metadata_yaml(splits, channels))
    if not (folder / SESSION_JSON).exists():
        return
    try:
        record = read_session(folder)
    except EdgeError as error:
        _log.warning("%s", error)
        return
    counts = counts_by_topic(splits)
    filled = [split for split in splits if split.messages]
    span_ns = max((one.end_ns for one in filled), default=0) - min((one.start_ns for one in filled), default=0)
    write_session(
        disk,
        folder,
        msgspec.structs.replace(
            record,
            state="unclean",
            reason="the recorder was cut off (power or kill); repaired at the next start",
            duration_s=span_ns / 1e9,
            bytes_written=sum(split.size_bytes for split in splits),
            messages=sum(counts.values()),
            counts=counts,
            splits=tuple(splits),
        ),
    )


def _survey(folder: Path) -> tuple[list[SplitFacts], list[Channel]]:
    splits: list[SplitFacts] = []
    channels: dict[str, Channel] = {}
    for path in sorted(folder.glob("*.mcap"), key=_split_number):
        try:
            facts, found = read_facts(path)
        except EdgeError as error:
            _log.warning("%s", error)
            continue
        splits.append(facts)
        channels.update({channel.topic: channel for channel in found})
    return splits, list(channels.values())


def _split_number(path: Path) -> tuple[int, str]:
    number = path.stem.rpartition("_")[2]
    return (int(number) if number.isdigit() else -1, path.name)
