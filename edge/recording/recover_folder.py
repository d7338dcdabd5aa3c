"""Recovery of a whole session or bag folder into a new one."""

from __future__ import annotations

import shutil
from pathlib import Path

from edge.errors import EdgeError, RecordingError
from edge.recording.bag import METADATA_YAML, metadata_yaml, read_facts
from edge.recording.recover import Progress, RecoverReport, recover
from edge.ros.topics import Channel

_KEPT = ("session.json",)
_ACTIVE = ".active"


def recover_folder(
    files: list[Path], source: Path, target: Path, progress: Progress | None = None
) -> tuple[list[RecoverReport], dict[str, str]]:
    """Recover `files` of the folder `source` into the new folder `target`, with a `metadata.yaml` that fits.

    Returns a report a file, and by name why others gave nothing. RecordingError when nothing could be recovered or
    `target` exists.
    """
    try:
        target.mkdir(parents=True)
    except OSError as error:
        raise RecordingError(f"{target}: cannot be made: {error.strerror}; name another folder") from error
    reports: list[RecoverReport] = []
    failed: dict[str, str] = {}
    for path in files:
        try:
            reports.append(recover(path, target / path.name.removesuffix(_ACTIVE), progress))
        except EdgeError as error:
            failed[path.name] = str(error)
    if not reports:
        target.rmdir()
        raise RecordingError(f"nothing in {source} can be recovered: {'; '.join(failed.values())}")
    _complete(source, target, [Path(report.target) for report in reports])
    return reports, failed


def _complete(source: Path, target: Path, files: list[Path]) -> None:
    """What makes a folder of files a bag."""
    channels: dict[str, Channel] = {}
    splits = []
    for path in files:
        facts, found = read_facts(path)
        splits.append(facts)
        channels |= {channel.topic: channel for channel in found}
    (target / METADATA_YAML).write_bytes(metadata_yaml(splits, channels.values()))
    for name in _KEPT:
        if (source / name).is_file():
            shutil.copyfile(source / name, target / name)
