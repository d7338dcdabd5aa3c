"""All files of a recording as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from edge.config import Config
from edge.errors import FormatError
from edge.validation.files import missing_splits, recording_files
from edge.validation.index import FileIndex, Topic, read_index
from edge.validation.rates import Span
from edge.validation.told import Told, recorded_config, session_facts, told


@dataclass(frozen=True, slots=True)
class Recording:
    """times: (n,) log times by topic, over all files. facts, said: what the recorder noted; None in foreign ones."""

    name: str
    files: list[FileIndex]
    unreadable: dict[str, str]
    missing_splits: list[int]
    topics: dict[str, Topic]
    conflicts: tuple[str, ...]
    times: dict[str, npt.NDArray[np.int64]]
    span: Span
    facts: dict[str, str] | None
    said: Told | None

    @classmethod
    def read(cls, targets: Sequence[Path]) -> Recording:
        """Index every file. FormatError when there is nothing to index."""
        paths = recording_files(targets)
        files, unreadable = _read_all(paths)
        given_up = [path.name for target in targets if target.is_dir() for path in target.glob("*.damaged")]
        unreadable |= dict.fromkeys(given_up, "the repair after a power cut found nothing in it that can be used")
        topics: dict[str, Topic] = {}
        conflicts = set()
        for name, topic in (item for index in files for item in index.topics.items()):
            if topics.setdefault(name, topic).type_name != topic.type_name:
                conflicts.add(name)
        series = {name: [index.series[name].times_ns for index in files if name in index.series] for name in topics}
        times = {name: np.concatenate(parts) for name, parts in series.items() if parts}
        return cls(
            name=", ".join(map(str, targets)),
            files=files,
            unreadable=unreadable,
            missing_splits=missing_splits(paths) if any(map(Path.is_dir, targets)) else [],
            topics=topics,
            conflicts=tuple(sorted(conflicts)),
            times=times,
            span=_span(times),
            facts=session_facts(files),
            said=told(files),
        )

    def effective(self, config: Config) -> Config:
        """Sensors and topic names as recorded, limits as asked for now."""
        recorded = recorded_config(self.facts) if self.facts is not None else None
        return msgspec.structs.replace(recorded, validation=config.validation) if recorded else config


def _read_all(paths: Sequence[Path]) -> tuple[list[FileIndex], dict[str, str]]:
    """A file that is not readable is a finding among others, and an error when it is the only one."""
    files: list[FileIndex] = []
    unreadable: dict[str, str] = {}
    for path in paths:
        try:
            files.append(read_index(path))
        except FormatError as error:
            if len(paths) == 1:
                raise
            unreadable[path.name] = str(error)
    if not files:
        raise FormatError(f"none of the files is a recording: {'; '.join(unreadable.values())}")
    return files, unreadable


def _span(times: dict[str, npt.NDArray[np.int64]]) -> Span:
    if not times:
        return Span(0, 0)
    return Span(min(int(one.min()) for one in times.values()), max(int(one.max()) for one in times.values()))
