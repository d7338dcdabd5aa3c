"""`mapforest batch`: all sessions of a directory, on the cores of this machine or of many."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.markup import escape
from rich.table import Table

from edge.cli import exit_codes
from edge.cli.batch_bar import BatchBar
from edge.cli.ending import end_with_the_terminal
from edge.cli.words import console
from edge.config import Config, load
from edge.errors import UsageError
from edge.words import duration

if TYPE_CHECKING:  # heavy: distributed
    from distributed import Client

    from edge.batch.plan import Step
    from edge.batch.schedule import Outcome

HELP = """process, refine and report over all sessions below a directory, several at a time

example: mapforest batch recordings
         mapforest batch recordings --workers 4 --no-refine
         mapforest batch /data/recordings --scheduler tcp://10.0.0.5:8786

Each worker is a process that works on one session at a time; what comes out is what the three commands make. What is
done is not done again: interrupted, or run again after more sessions came, it goes on from there. A session that fails
does not stop the others: the list at the end has its reason, and the exit code is 1. The report is on the refined
products where there are some. Needs the extra `cluster`; without the extra `refine` that part is left out.

A scheduler and workers of other machines need the same version of mapforest. Workers see the directory at the same
place, and declare their memory: dask worker ADDRESS --nworkers 4 --nthreads 1 --resources 'memory=8e9' (bytes, each)"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("directory", type=Path, help="where the sessions are, at any depth")
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--workers", type=int, metavar="N", help="at most, on this machine (default: its cores); memory may allow fewer"
    )
    where.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster that runs already")
    parser.add_argument("--no-refine", action="store_true", help="leave the refinement out")
    parser.add_argument(
        "--detect", metavar="MODEL", help='ONNX file of the detector, "demo" for ours, "" for none (detection.model)'
    )


def run(args: argparse.Namespace) -> int:
    """Failed where a session did, warnings where one ended with some."""
    if find_spec("distributed") is None:
        raise UsageError("batch: Dask's scheduler is not installed; run `pip install 'mapforest[cluster]'`")
    if args.workers is not None and args.workers < 1:
        raise UsageError(f"--workers {args.workers}: one at least")
    from edge.batch.sessions import find_sessions

    end_with_the_terminal()
    directory = args.directory.resolve()
    sessions, config = find_sessions(directory), _config(args)
    with BatchBar(directory, len(sessions)) as bar:
        outcomes = _worked(args, directory, sessions, config, bar)
    if args.json:
        print(msgspec.json.encode(outcomes).decode())
    else:
        out = console()
        out.print(_table(directory, outcomes))
        for one in outcomes:
            for stage, reason in one.failed.items():
                out.print(
                    f"[red]{escape(_name(directory, one))}[/] {stage}: {escape(reason)}",
                    highlight=False,
                    soft_wrap=True,
                )
    if any(one.failed for one in outcomes):
        return exit_codes.FAILED
    warned = any(done.warning for one in outcomes for done in one.done.values())
    return exit_codes.WARNINGS if warned else exit_codes.GOOD


def _worked(
    args: argparse.Namespace, directory: Path, sessions: Sequence[Path], config: Config, bar: BatchBar
) -> list[Outcome]:
    from edge.batch.cluster import fit_workers, hush
    from edge.batch.plan import most_memory, plan
    from edge.batch.run import Batch
    from edge.batch.worker import can_refine

    if not args.verbose:
        hush()
    refine = not args.no_refine
    if refine and not args.scheduler and not can_refine():
        bar.say("the refinement is left out: it needs the extra `refine`, which is not installed")
        refine = False
    plans = [plan(session, refine=refine) for session in sessions]
    with _cluster(args, plans, bar) as client:
        looks = fit_workers(client, directory, len(sessions))
        if refine and not all(one.refine for one in looks):
            bar.say("the refinement is left out: not all workers have the extra `refine`")
            plans = [plan(session, refine=False) for session in sessions]
        memory = max(one.memory for one in looks)
        if memory < (needed := most_memory(plans)):
            bar.say(f"the biggest step may take {needed / 1e9:.1f} GB, the biggest worker has {memory / 1e9:.1f} GB")
        if args.scheduler:
            bar.say(f"{_count(len(looks), 'worker')} for {_count(len(sessions), 'session')}")
        return Batch(client, config, bar, memory).run(plans)


def _cluster(
    args: argparse.Namespace, plans: Sequence[Sequence[Step]], bar: BatchBar
) -> AbstractContextManager[Client]:
    from edge.batch.cluster import existing, local, memory_bytes
    from edge.batch.plan import most_memory, worker_count

    if args.scheduler:
        return existing(args.scheduler)
    asked, there = args.workers or len(os.sched_getaffinity(0)), memory_bytes()
    workers = worker_count(asked, len(plans), most_memory(plans), there)
    if workers < min(asked, len(plans)):
        bar.say(f"{workers} workers, not {asked}: {there / 1e9:.1f} GB have no room for more")
    bar.say(f"starting {_count(workers, 'worker')} for {_count(len(plans), 'session')}")
    return local(workers, there)


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"


def _config(args: argparse.Namespace) -> Config:
    """With paths that mean the same wherever a worker runs."""
    from edge.detection import DEMO

    config: Config = load(args.config)
    model = config.detection.model if args.detect is None else args.detect
    if model not in {"", DEMO}:
        model = str(Path(model).expanduser().resolve())
    calibration = str(Path(config.calibration).expanduser().resolve()) if config.calibration else ""
    detection = msgspec.structs.replace(config.detection, model=model)
    return msgspec.structs.replace(config, detection=detection, calibration=calibration)


def _table(directory: Path, outcomes: Sequence[Outcome]) -> Table:
    from edge.batch.plan import STAGES

    failed = sum(bool(one.failed) for one in outcomes)
    title = f"{len(outcomes) - failed} of {len(outcomes)} sessions done" + (f", {failed} failed" if failed else "")
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    for column in ("session", *STAGES, "", "where"):
        table.add_column(column, overflow="fold")
    for one in outcomes:
        warning = next((done.warning for done in reversed(one.done.values()) if done.warning), "")
        last = next((done.output for done in reversed(one.done.values())), "")
        where = str(Path(last).relative_to(directory)) if last else ""
        cells = [_cell(one, stage) for stage in STAGES]
        table.add_row(escape(_name(directory, one)), *cells, escape(warning), escape(where))
    return table


def _cell(one: Outcome, stage: str) -> str:
    if stage in one.failed:
        return "[red]failed[/]"
    done = one.done.get(stage)
    if done is None:
        return "-"
    return duration(done.seconds) if done.redone else "was done"


def _name(directory: Path, one: Outcome) -> str:
    path = Path(one.session)
    return path.name if path == directory else str(path.relative_to(directory))
