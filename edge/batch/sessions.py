"""The recordings below a directory."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from edge.errors import UsageError

_RECORDINGS = (".mcap", ".mcap.active", ".db3")
"""The last cannot be read; said of the session by name, it is not overlooked."""
_ABOUT = ("session.json", "metadata.yaml")


def find_sessions(directory: Path) -> list[Path]:
    """Folders of sessions and single files, at any depth, in the order of their names; the directory itself where it is
    a session. UsageError where there are none.

    The .mcap files of a folder are one session where it says so, or where they are numbered; otherwise each is its own.
    """
    try:
        found = list(_below(directory))
    except NotADirectoryError:
        raise UsageError(f"{directory}: no directory; for one file there is `mapforest process`") from None
    except OSError as error:
        raise UsageError(f"{directory}: cannot be looked into ({error.strerror})") from error
    if not found:
        empty = "is empty" if not any(directory.iterdir()) else "holds no session: no folder below it has an .mcap file"
        raise UsageError(f"{directory} {empty}; give the directory that the recordings were copied to")
    return found


def _below(folder: Path) -> Iterator[Path]:
    inside = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    files = [path for path in inside if path.is_file() and path.name.endswith(_RECORDINGS)]
    if files and _is_session(folder, files):
        yield folder
        return
    for path in inside:
        if path in files:
            yield path
        elif path.is_dir() and not path.is_symlink():
            yield from _below(path)


def _is_session(folder: Path, files: list[Path]) -> bool:
    if any((folder / name).exists() for name in _ABOUT):
        return True
    numbered = [re.fullmatch(r"(.+)_\d+\.(mcap(\.active)?|db3)", path.name) for path in files]
    return all(numbered) and len({match[1] for match in numbered if match}) == 1
