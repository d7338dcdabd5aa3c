"""One step of a session, as the commands of the same names do it."""

from __future__ import annotations

import time
from pathlib import Path

import msgspec

from edge import __version__
from edge.batch.plan import Step
from edge.config import Config
from edge.process.checkpoint import Checkpoint, alone, fingerprint, key_of
from edge.process.looked_with import looked_with
from edge.process.process import Task, process
from edge.process.product_facts import PRODUCTS_JSON, REPORT, ProductFacts, read_facts
from edge.process.watch import Watch
from edge.recording.folder import SESSION_JSON
from edge.validation.files import recording_files


class Finished(msgspec.Struct, frozen=True):
    """redone: parts of the stage that had to be done, none where it was done before. output: folder or page.

    warning: what the command of that name would end with warnings for.
    """

    output: str
    redone: tuple[str, ...]
    seconds: float
    warning: str = ""


def work(step: Step, config: Config, watch: Watch) -> Finished:
    """Do it, or find that it is done. EdgeError, DetectionError with the session's own reason."""
    begun_s = time.monotonic()
    task = Task([step.session])
    config = looked_with(config, None, [task.folder])
    if step.stage == "report":
        page, redone = _report(task, config, watch, refined=step.refined)
        return Finished(str(page), redone, time.monotonic() - begun_s)
    if step.stage == "refine":
        from edge.process.refine import refine  # noqa: PLC0415 - GTSAM, where it is asked for

        refined = refine(task, config, watch=watch)
        folder, facts, redone = refined.folder, refined.facts, refined.redone
    else:
        done = process(task, config, watch)
        folder, facts, redone = done.folder, done.facts, done.redone
    return Finished(str(folder), redone, time.monotonic() - begun_s, _warning(facts))


def _report(task: Task, config: Config, watch: Watch, *, refined: bool) -> tuple[Path, tuple[str, ...]]:
    """The page is made again when anything that it shows has changed, an analyst's word on a tree too."""
    from edge.process.refine import FOLDER  # noqa: PLC0415
    from edge.report.report import write_report  # noqa: PLC0415

    folder = task.folder / FOLDER if refined else task.folder
    page = folder / REPORT
    with alone(folder / "work"):
        checkpoint = Checkpoint(folder / "work")
        shown = [
            task.targets[0] / SESSION_JSON,
            *(folder / name for name in (PRODUCTS_JSON, *read_facts(folder).files)),
        ]
        shown = [*recording_files(task.targets), *(path for path in shown if path.is_file())]
        key = key_of(__version__, config, fingerprint(shown))
        done = checkpoint.done("report", key, [page])
        watch.stage("report", done=done)
        if not done:
            write_report(Task(task.targets, folder), config)
            checkpoint.finish("report", key)
    return page, () if done else ("report",)


def _warning(facts: ProductFacts) -> str:
    if facts.estimates < 0.9 * facts.sweeps:
        return f"{facts.sweeps - facts.estimates} of {facts.sweeps} sweeps without an estimate"
    return "not on the Earth: a local map" if facts.datum is None else ""
