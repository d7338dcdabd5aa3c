"""The page, put together from a session's recording and its products, as far as there are any."""

from __future__ import annotations

from pathlib import Path

from edge.config import Config
from edge.errors import EdgeError
from edge.process.process import Task
from edge.process.product_facts import REPORT, whole
from edge.recording.folder import SESSION_JSON, SessionRecord, read_session
from edge.report.advice import advise
from edge.report.location import gnss_parts, location_parts
from edge.report.made import read_made
from edge.report.plan import plan_parts, tree_parts
from edge.report.sensors import sensor_parts
from edge.report.verdict import marks, verdict_parts
from edge.validation.validate import validate
from pipeline.products import sheet


def write_report(task: Task, config: Config, path: Path | None = None) -> Path:
    """To `path`, or beside the products. FormatError when there is no recording; what is missing in it is said."""
    judged = validate(list(task.targets), config)
    record = _record(task.targets[0])
    made = read_made(task.folder)
    parts = [
        *verdict_parts(judged, record, made, advise(made)),
        marks(record),
        *plan_parts(made, record),
        *tree_parts(made),
        *sensor_parts(task.targets, judged, config),
        *gnss_parts(made, judged.gnss, judged.start_ns),
        *location_parts(made, judged.start_ns),
    ]
    if made is not None and made.facts.notes:
        parts.append(sheet.notes(made.facts.notes))
    path = path or task.folder / REPORT
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as draft:
            draft.write_text(sheet.sheet(task.session, parts), encoding="utf-8")
    except OSError as error:
        raise EdgeError(f"{path}: cannot be written ({error.strerror}); give another place with --output") from error
    return path


def _record(target: Path) -> SessionRecord | None:
    """Of a session of ours."""
    return read_session(target) if (target / SESSION_JSON).exists() else None
