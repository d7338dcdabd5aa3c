"""Which files make up a recording."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from edge.errors import FormatError


def recording_files(targets: Sequence[Path]) -> list[Path]:
    """The MCAP files of sessions, bag folders or single files, in order. FormatError when there are none."""
    return [path for target in targets for path in _files(target)]


def _files(target: Path) -> list[Path]:
    try:
        if not target.is_dir():
            return [target]
        inside = [path for path in target.iterdir() if path.is_file()]
    except PermissionError as error:
        raise FormatError(f"{target}: not allowed to look into it; check its owner and mode, or use sudo") from error
    found = [path for path in inside if path.name.endswith((".mcap", ".mcap.active")) and not path.name.startswith(".")]
    if found:
        return sorted(found, key=_natural)
    if any(path.suffix == ".db3" for path in inside):
        raise FormatError(f"{target} is a bag in the sqlite3 format; convert it first: `ros2 bag convert` to mcap")
    if any(path.is_dir() and any(path.glob("*.mcap*")) for path in target.iterdir()):
        raise FormatError(f"{target} holds several recordings; name one of the folders in it")
    raise FormatError(f"{target}: there is no recording (*.mcap) in this folder")


def _natural(path: Path) -> list[tuple[int, str]]:
    """`_2` before `_10`."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name)]


def missing_splits(files: Sequence[Path]) -> list[int]:
    """Numbers that are absent from a run of `<session>_<n>.mcap`, the first included."""
    numbers = [re.fullmatch(r"(.+)_(\d+)\.mcap(\.active)?", path.name) for path in files]
    found = {(match[1], int(match[2])) for match in numbers if match}
    if len(found) != len(files) or len({stem for stem, _ in found}) != 1:
        return []
    present = {number for _, number in found}
    return sorted(set(range(max(present) + 1)) - present)
