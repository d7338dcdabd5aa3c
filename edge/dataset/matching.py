"""Which image of a dataset Label Studio means: it puts hashes before names, cuts long ones, and quotes others."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import PurePosixPath
from urllib.parse import unquote

from edge.dataset.image import ENDINGS
from pipeline.dataset.record import ImageRecord

CUT = 251
"""Label files are called after at most so much of the image's name."""
_PREFIX = re.compile(r"^[0-9a-f]{6,8}(-|__)")


class Matching:
    """By stem, exact first."""

    def __init__(self, records: Sequence[ImageRecord]) -> None:
        self._by_stem = {record.stem: record for record in records}

    def find(self, told: str) -> ImageRecord | None:
        """The image that a label file's stem or a task's image names; None where none or several fit."""
        for stem in readings(told):
            if stem in self._by_stem:
                return self._by_stem[stem]
            if len(stem.encode()) >= CUT - 3:  # a cut in the middle of a letter loses up to three bytes more
                fitting = [one for name, one in self._by_stem.items() if name.startswith(stem)]
                if len(fitting) == 1:
                    return fitting[0]
        return None


def readings(told: str) -> Iterator[str]:
    """What the stem of the image may be, likeliest first."""
    path = told.partition("?d=")[2] or told.partition("?")[0]
    for name in dict.fromkeys((PurePosixPath(path).name, PurePosixPath(unquote(path)).name)):
        stem = name[: -len(PurePosixPath(name).suffix)] if name.lower().endswith(ENDINGS) else name
        yield stem
        if _PREFIX.match(stem):
            yield _PREFIX.sub("", stem)
