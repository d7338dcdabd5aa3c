"""What is there for faults alone, one thing at a time switched off, on the faults it is there for; a table in Markdown.

    python -m benchmarks.odometry.faults.ablation --cache DIR [--only NAME ...]

Columns as in `benchmarks.odometry.faults`, each with the thing and without it.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

from benchmarks.odometry.ablation import NEVER, configured
from benchmarks.odometry.faults.catalogue import ALL_S, CASES, PLAIN, Case, cast, cast_walk
from benchmarks.odometry.faults.streams import Span, Streams
from benchmarks.odometry.faults.trial import Outcome, tried
from drivers.messages import ImuSample
from drivers.sim.scenarios import scenario
from pipeline.odometry import filter as filters
from pipeline.odometry import initialise, start, tracker
from pipeline.odometry.fit import Fit, Fitting
from pipeline.odometry.imu_buffer import ImuBuffer
from pipeline.odometry.time_gate import TimeGate
from pipeline.odometry.watch import Watch


@dataclass(frozen=True, slots=True)
class Absence:
    """One thing less. cases: names of the catalogue. swaps: (where, name, what stands there instead)."""

    name: str
    cases: tuple[str, ...]
    swaps: tuple[tuple[Any, str, Any], ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)

    @contextmanager
    def felt(self) -> Iterator[None]:
        """While it lasts the odometry lacks the thing."""
        patches = [patch.object(where, name, instead) for where, name, instead in self.swaps]
        for one in patches:
            one.start()
        try:
            yield
        finally:
            for one in patches:
                one.stop()


def _where_it_is(_known: object, _seen: object, guess: object, _yaw_sigma: float, _reach_m: float) -> object:
    return guess


def _still(_clouds: object, _times_s: object) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


def _all_fit(self: Fitting, residuals: object, unheard_s: float) -> Fit:
    return Fit.GOOD


def _let_through(self: TimeGate[Any], message: Any, other_ns: int | None = None) -> list[Any]:
    self.newest_ns = max(message.stamp_ns, self.newest_ns or 0)
    return [message]


def _as_it_comes(add: Callable[[ImuBuffer, ImuSample], None]) -> Callable[[ImuBuffer, ImuSample], None]:
    def in_order_alone(self: ImuBuffer, sample: ImuSample) -> None:
        if sample.stamp_ns > self.newest_ns:
            add(self, sample)

    return in_order_alone


def _later(streams: Streams, span: Span) -> Streams:
    scans = tuple(scan for scan in streams.scans if span.holds(scan))
    return replace(streams, scans=scans, imu=tuple(sample for sample in streams.imu if span.holds(sample)))


RIDE = replace(scenario("bicycle"), name="faults_ride", schedule=PLAIN.schedule, length_m=100.0)
KNOWN = CASES | {"joined": Case("a ride joined on the way", _later, 13.0, ALL_S)}
ABSENCES = (
    Absence(
        "samples never doubted (`filter.py`)",
        ("gyro_bias", "gyro_bias_large", "accel_bias_large", "in_g_midway", "saturated_unknown", "offset_20"),
        ((filters, "SURPRISING", math.inf),),
    ),
    Absence(
        "range of the sensor not known",
        ("saturated",),
        settings={"imu.gyro_range_rad_s": NEVER, "imu.accel_range_m_s2": NEVER},
    ),
    Absence(
        "not sought in the map after a silence (`relocate.py`)",
        ("samples_07", "samples_3", "silence_3"),
        ((tracker, "relocate", _where_it_is),),
    ),
    Absence(
        "scans that do not fit are taken in (`fit.py`)",
        ("crown", "elsewhere", "silence_8"),
        ((Fitting, "judge", _all_fit),),
    ),
    Absence(
        "never restarted for misfits (`watch.py`)",
        ("elsewhere", "field"),
        ((Watch, "broken", lambda _self, _filter: ""),),
    ),
    Absence(
        "weak directions not damped (`degeneracy.py`)",
        ("field", "handful", "ground"),
        settings={"degeneracy.attitude_rad": NEVER, "degeneracy.position_m": NEVER},
    ),
    Absence("drift does not grow along weak directions (`drift.py`)", ("field",), settings={"drift.weak": 0.0}),
    Absence("dust tags not read", ("dust_tagged", "rain"), ((tracker, "DUST_MASK", 0),)),
    Absence("no Huber loss", ("walkers", "companions", "dust", "rain", "wind"), settings={"match.huber": NEVER}),
    Absence("no gate on residuals", ("walkers", "companions", "dust", "rain", "wind"), settings={"match.gate": NEVER}),
    Absence(
        "leaping stamps go through (`time_gate.py`)",
        ("leap_scan", "leap_sample", "leap_second", "leap_on"),
        ((TimeGate, "admit", _let_through),),
    ),
    Absence(
        "samples not put in order (`imu_buffer.py`)",
        ("samples_disordered",),
        ((ImuBuffer, "add", _as_it_comes(ImuBuffer.add)),),
    ),
    Absence("unit of the accelerometer not found", ("in_g",), ((start, "force_scale", lambda _rows: 1.0),)),
    Absence(
        "speed at the start not sought (`rough_velocity.py`)", ("joined",), ((initialise, "rough_velocity", _still),)
    ),
)


def main() -> None:
    options = _options()
    print("| without | fault | worst, cm | end, cm | stated, cm | outside | no pose for, s |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    walks = cache(lambda name: _walk(name, options.cache))
    usual = cache(lambda name: tried(KNOWN[name], walks(name)))
    for absence in ABSENCES:
        if options.only and absence.name not in options.only:
            continue
        for name in absence.cases:
            with absence.felt():
                lacking = tried(_with(KNOWN[name], absence.settings), walks(name))
            print(f"| {absence.name} | {KNOWN[name].name} | {_cells(usual(name), lacking)} |", flush=True)


def _walk(name: str, folder: Path) -> Streams:
    return cast_walk(RIDE, folder, 22.0) if name == "joined" else cast(folder, turning=KNOWN[name].turning)


def _with(case: Case, settings: dict[str, Any]) -> Case:
    return replace(case, config=configured(settings)) if settings else case


def _cells(usual: Outcome, lacking: Outcome) -> str:
    def figures(of: Outcome) -> list[str]:
        lengths = [f"{100.0 * value:.0f}" for value in (of.worst_m, of.end_m, of.end_sigma_m)]
        return [*lengths, f"{of.outside:.0%}", f"{of.silent_s:.1f}"]

    return " | ".join(f"{a} → {b}" for a, b in zip(figures(usual), figures(lacking), strict=True))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where cast walks are kept")
    parser.add_argument("--only", nargs="+", default=[], help="names of what is left out")
    return parser.parse_args()


if __name__ == "__main__":
    main()
