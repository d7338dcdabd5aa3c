"""`mapforest demo`: the whole mission on the emulated payload."""

from __future__ import annotations

import argparse
import importlib
import logging
from pathlib import Path

import msgspec
from rich.console import Console
from rich.live import Live
from rich.progress import Progress
from rich.table import Table

from drivers.sim.payload import Payload
from drivers.sim.scenarios import scenario
from edge import demo
from edge.cli import exit_codes
from edge.cli.ending import end_with_the_terminal
from edge.cli.evaluate import clock_table
from edge.cli.stage_bar import StageBar
from edge.cli.trajectories import show
from edge.cli.trees import show as show_trees
from edge.config import load
from edge.control.client import ControlClient
from edge.control.messages import Status, Verdict
from edge.process.against_truth import find_pairs
from edge.process.process import Done, Task, process
from edge.process.trees_against_truth import ComparedTrees, compare_trees
from edge.report.report import write_report
from edge.validation.clock_truth import ClockReport, clock_reports
from pipeline.evaluation.pair import Compared, compare
from pipeline.products.comparison import write_comparison

HELP = """the whole mission on the emulated payload: record a walk, validate it, map it, compare with the truth

example: mapforest demo --seed 3
         mapforest demo --tui      (press the keys yourself: space starts, space twice stops, q leaves)

Three emulated sensors speak their real protocols from one simulated forest; a recorder records them as on the
payload, and the live pipeline finds the way and the trees beside it, with a detector that knows the simulated forest
only. Then the recording is turned into maps and a report. The outputs stay in the folder demo/."""
RPE_OVER_M = 10.0
"""The walk of the demonstration is 43 m long."""
_EXIT = {"PASS": exit_codes.GOOD, "WARN": exit_codes.WARNINGS, "FAIL": exit_codes.FAILED}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--scenario", default="demo", help="which walk (`mapforest sim --list` names them)")
    parser.add_argument("--seed", type=int, help="another forest and walk of the same kind")
    parser.add_argument("--folder", type=Path, default=Path("demo"), help="where everything goes")
    parser.add_argument("--tui", action="store_true", help="open the operator's screen instead of pressing the keys")


def run(args: argparse.Namespace) -> int:
    """Exit code as the verdict: 0 PASS, 3 WARN, 1 FAIL."""
    end_with_the_terminal()
    console = Console(stderr=args.json)
    stage = demo.Stage(args.folder.absolute())
    config = demo.payload_config(stage, scenario(args.scenario, args.seed))
    demo.prepare(stage, config)
    console.print(
        "starting the emulated payload and the live pipeline (the first time on a machine they are compiled: about a "
        "minute) ..."
    )
    with (
        demo.recorder(stage) as client,
        demo.pipeline(stage) as live,
        Payload(config, lambda: _wait(stage, live, client, console)) as payload,
    ):
        if args.tui:
            _operate(stage)
            _what_next(console, stage)
            return exit_codes.GOOD
        folder, verdict = _mission(client, payload, console)
    done, poses = _locate(folder, stage, quiet=args.json)
    report, trees = _report(folder, stage, console, done)
    reports = clock_reports(folder, stage.truth)
    if args.json:
        told = {"session": str(folder), "verdict": verdict, "clocks": reports, "trajectory": poses, "trees": trees}
        told["detection"] = done.facts.detection
        print(msgspec.json.encode(told).decode())
    else:
        show(console, poses)
        if trees is not None:
            show_trees(console, trees)
        _conclude(console, folder, verdict, reports)
        if (found := done.facts.detection) is not None:
            counted = f"{found.boxes} boxes in {found.images} images, by {found.model.name}"
            console.print(f"detection   {counted} (for demonstration only)", highlight=False)
        console.print(f"report      {report}  (verdict, map, trees: start here)", highlight=False)
        console.print(f"products    {done.folder}", highlight=False)
        for name, meaning in done.facts.files.items():
            console.print(f"            {name}  {meaning}", highlight=False)
        console.print(f"evaluation  {stage.plots}  (plots of the errors above)", highlight=False)
    return _EXIT[verdict.verdict]


def _wait(stage: demo.Stage, live: demo.Process, client: ControlClient, console: Console) -> None:
    console.print("the sensors are ready; waiting for the live pipeline, so that it sees the walk from the start ...")
    demo.wait_for_pipeline(stage, live, client)


def _mission(client: ControlClient, payload: Payload, console: Console) -> tuple[Path, Verdict]:
    with _Screen(console) as screen:
        demo.wait_for_sensors(client, screen.show)
        folder = demo.record_walk(client, payload, screen.show)
        return folder, demo.wait_for_verdict(client, screen.show)


def _locate(folder: Path, stage: demo.Stage, *, quiet: bool) -> tuple[Done, list[Compared]]:
    """The onboard pipeline over the recording, and its poses beside the true ones."""
    logging.getLogger("pyogrio").setLevel(logging.WARNING)  # it counts every record it writes
    with StageBar(quiet=quiet) as bar:
        done = process(Task([folder]), load(stage.config), bar)
    pairs = find_pairs(folder, stage.truth)
    write_comparison(stage.plots, f"Trajectories of {folder.name}", pairs)
    return done, compare(pairs, RPE_OVER_M)


def _report(folder: Path, stage: demo.Stage, console: Console, done: Done) -> tuple[Path, ComparedTrees | None]:
    """The session's page; and the mapped trees beside the true ones, where a detector looked."""
    config = load(stage.config)
    with console.status("drawing the report, and looking through the true forest for what the camera saw ..."):
        report = write_report(Task([folder]), config)
        looked = done.facts.findings is not None
        return report, compare_trees(folder, stage.truth, config.grounding.probable) if looked else None


def _operate(stage: demo.Stage) -> None:
    # The screen is a floor above: named by a string, as in the table of commands.
    importlib.import_module("ui.command").run(stage.socket)


def _what_next(console: Console, stage: demo.Stage) -> None:
    """Of what the operator recorded, how to go on with the last."""
    sessions = sorted((stage.folder / "recordings").glob("*/session.json"))
    if sessions:
        session = sessions[-1].parent
        console.print(f"recording   {session}", highlight=False)
        for label, command in (
            ("next", f"process {session} --config {stage.config}"),
            ("", f"evaluate trajectory {session} --truth {stage.truth} --over {RPE_OVER_M:g}"),
        ):
            console.print(f"{label:11} mapforest {command}", highlight=False, soft_wrap=True)


class _Screen:
    """What the demonstration shows while it runs."""

    def __init__(self, console: Console) -> None:
        self._live = Live(console=console, refresh_per_second=2, transient=True)
        self._progress = Progress(console=console)
        self._walk = self._progress.add_task("walk", total=1.0)

    def __enter__(self) -> _Screen:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, status: Status, share: float) -> None:
        """One state."""
        self._progress.update(self._walk, completed=share)
        grid = Table.grid()
        grid.add_row(_sensors(status))
        grid.add_row(self._progress)
        self._live.update(grid)


def _sensors(status: Status) -> Table:
    recording = status.recording
    title = (
        f"{status.state}  {recording.elapsed_s:4.0f} s  {recording.bytes_written / 1e6:.0f} MB"
        if recording
        else status.state
    )
    table = Table(title=title, title_justify="left", box=None)
    for column in ("sensor", "state", "rates", "lost", ""):
        table.add_column(column)
    for sensor in status.sensors:
        rates = "  ".join(f"{s.name} {s.rate_hz:.1f}/{s.expected_hz:g} Hz" for s in sensor.streams)
        table.add_row(sensor.name, sensor.state, rates, str(sum(s.lost for s in sensor.streams)), sensor.problem)
    return table


def _conclude(console: Console, folder: Path, verdict: Verdict, reports: list[ClockReport]) -> None:
    console.print(clock_table(reports))
    style = {"PASS": "bold green", "WARN": "bold yellow", "FAIL": "bold red"}[verdict.verdict]
    console.print(f"[{style}]{verdict.verdict}[/]  {verdict.session}")
    for reason in verdict.reasons:
        console.print(f"  {reason}")
    console.print(f"\nrecording   {folder}  (a rosbag2 folder; Foxglove opens its .mcap files)")
    for path in sorted(folder.iterdir()):
        console.print(
            f"            {path.name}  {path.stat().st_size / 1e6:.1f} MB" if path.is_file() else "",
            end="\n" if path.is_file() else "",
        )
    console.print(f"truth       {folder.parents[1] / 'truth'}  (poses, stems, clocks; no driver ever saw it)")
    console.print(f"next        mapforest info {folder}")
