"""Which stages of the work on a recording are done, for which input and settings."""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import msgspec

from edge.errors import EdgeError

_SAMPLED = 1 << 16


class _State(msgspec.Struct):
    """`state.json`. stages: name -> key of what it was made from."""

    stages: dict[str, str] = {}


class Checkpoint:
    """The work folder. A stage is done when its key stands here; keys chain, so a change redoes what follows."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._path = folder / "state.json"
        self._state = _State()
        if self._path.exists():
            try:
                self._state = msgspec.json.decode(self._path.read_bytes(), type=_State)
            except msgspec.MsgspecError:  # written by another version: everything is done again
                self._state = _State()

    def done(self, stage: str, key: str, outputs: Sequence[Path] = ()) -> bool:
        """Whether the stage was finished from exactly this, and its outputs are still there."""
        return self._state.stages.get(stage) == key and all(path.exists() for path in outputs)

    def key(self, stage: str) -> str:
        """Of what a finished stage was made from; empty where it is not finished."""
        return self._state.stages.get(stage, "")

    def begin(self, stage: str) -> Path:
        """An empty folder for the stage's own files."""
        self._state.stages.pop(stage, None)
        self._write()
        folder = self.folder / stage
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder

    def finish(self, stage: str, key: str) -> None:
        """Remember it."""
        self._state.stages[stage] = key
        self._write()

    def _write(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        draft = self._path.with_suffix(".draft")
        with draft.open("wb") as file:
            file.write(msgspec.json.encode(self._state))
            file.flush()
            os.fsync(file.fileno())
        draft.replace(self._path)


def key_of(*parts: object) -> str:
    """A digest of anything msgspec can encode."""
    return hashlib.sha256(msgspec.json.encode(parts, order="sorted")).hexdigest()


def fingerprint(files: Sequence[Path]) -> list[tuple[str, int, str]]:
    """Name, size and a digest of both ends of each file: a recording is written once, and its end holds checksums."""
    found = []
    for path in files:
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(_SAMPLED)
            file.seek(max(0, size - _SAMPLED))
            digest = hashlib.sha256(head + file.read(_SAMPLED)).hexdigest()
        found.append((path.name, size, digest))
    return found


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """EdgeError when another process works in this folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise EdgeError(
                f"{folder}: another `mapforest process` is at work there; wait for it, or end it"
            ) from error
        yield
