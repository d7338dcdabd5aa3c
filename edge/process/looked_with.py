"""Which detector a session was looked at with: the next command on it need not be told again."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import msgspec

from edge.config import Config

MODEL = "detector.txt"
"""In the work folder: `detection.model` of the last run that looked."""


def remember(work: Path, model: str) -> None:
    """model: `detection.model` as it was used."""
    from edge.detection import DEMO, model_path  # noqa: PLC0415 - OpenCV, and only where a model is used

    lasting = model if model == DEMO else str(model_path(model).absolute())
    (work / MODEL).write_text(lasting, encoding="utf-8")


def looked_with(config: Config, asked: str | None, products: Iterable[Path]) -> Config:
    """The configuration with the detector that is meant. products: folders of the sessions.

    asked: of the command line, "" for no detector, which also forgets the last one; None for what is configured or,
    where nothing is, the detector of the last run.
    """
    model = config.detection.model if asked is None else asked
    for folder in products:
        memory = folder / "work" / MODEL
        if asked == "":
            memory.unlink(missing_ok=True)
        elif not model and memory.exists():
            model = memory.read_text(encoding="utf-8")
    return msgspec.structs.replace(config, detection=msgspec.structs.replace(config.detection, model=model))
