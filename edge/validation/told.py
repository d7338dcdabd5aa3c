"""What a recording of ours says about itself: the metadata records `session` and `mapforest`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from edge.config import Config
from edge.validation.index import FileIndex

SESSION = "session"
SUMMARY = "mapforest"
SUMMARY_KEY = "summary"
_CONFIG_KEYS = ("config_toml", "config")


class Drops(msgspec.Struct, frozen=True):
    """Messages of a topic the queue had no room for."""

    count: int = 0


class Note(msgspec.Struct, frozen=True):
    """The last diagnostics of one part."""

    level: int = 0
    message: str = ""
    values: dict[str, str] = {}


class HostClock(msgspec.Struct, frozen=True):
    """The clock of the recording computer."""

    synchronised_at_start: bool = True
    source: str = ""
    drift_ms: float = 0.0
    steps: int = 0


class Told(msgspec.Struct, frozen=True):
    """The end record of the last split that has one. Unknown keys are ignored: newer recorders may say more."""

    session: str = ""
    split: int = 0
    ended: str = ""
    dropped: dict[str, Drops] = {}
    diagnostics: dict[str, Note] = {}
    first_diagnostics: dict[str, Note] = {}
    gnss_quality: dict[str, int] = {}
    clock: HostClock | None = None
    marks: tuple[Any, ...] = ()
    last: bool = False
    """Set here: it is the record of the last file, so it speaks of the whole session."""


def told(files: Sequence[FileIndex]) -> Told | None:
    """The latest end record; None in foreign recordings and in those that a power cut ended in their first split."""
    for index in reversed(files):
        text = index.metadata.get(SUMMARY, {}).get(SUMMARY_KEY)
        if text is None:
            continue
        try:
            found = msgspec.json.decode(text, type=Told)
        except msgspec.MsgspecError:
            return None
        return msgspec.structs.replace(found, last=index is files[-1])
    return None


def session_facts(files: Sequence[FileIndex]) -> dict[str, str] | None:
    """The begin record of the first file that has one; None in foreign recordings."""
    return next((index.metadata[SESSION] for index in files if SESSION in index.metadata), None)


def recorded_config(facts: dict[str, str]) -> Config | None:
    """The configuration the session was recorded with; None where it cannot be read any more."""
    text = next((facts[key] for key in _CONFIG_KEYS if key in facts), None)
    if text is None:
        return None
    try:
        return msgspec.toml.decode(text, type=Config)
    except (msgspec.MsgspecError, ImportError):
        return None
