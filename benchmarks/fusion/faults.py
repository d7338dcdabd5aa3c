"""What can befall the fixes, and what the live fusion made of it; prints a table in Markdown.

    python -m benchmarks.fusion.faults --cache DIR

One walk of 800 m with the odometry as it is. Errors are three-dimensional, against the truth, unaligned.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.fusion.odometry import Odometry
from benchmarks.fusion.table import received
from benchmarks.fusion.tracked import tracked
from drivers.messages import GnssFix
from drivers.sim.scenarios import scenario
from drivers.sim.world import World, build
from pipeline.gnss.fusion import GnssFusion
from pipeline.gnss.geodesy import Datum

SECOND_NS = 1_000_000_000
MIDDLE_S, LAST_S, OUTSIDE_SIGMAS = 300.0, 60.0, 4.0
Fixes = list[GnssFix]


@dataclass(frozen=True, slots=True)
class Case:
    """fixes: what becomes of the ones received under a preset of `drivers.sim.gnss_errors`."""

    name: str
    fault: Callable[[Fixes], Fixes]
    preset: str = "honest"


def between(begin_s: float, end_s: float) -> Callable[[Fixes], Fixes]:
    """Only those of a stretch."""
    return lambda fixes: [fix for fix in fixes if begin_s <= fix.stamp_ns / SECOND_NS < end_s]


def later(delivered_s: float = 0.0, stamped_s: float = 0.0) -> Callable[[Fixes], Fixes]:
    """Delivered late, or stamped wrong."""
    by_ns, stamp_ns = int(delivered_s * SECOND_NS), int(stamped_s * SECOND_NS)
    return lambda fixes: [
        replace(fix, receive_ns=fix.receive_ns + by_ns, stamp_ns=fix.stamp_ns + stamp_ns) for fix in fixes
    ]


def elsewhere(east_m: float, north_m: float, begin_s: float, end_s: float) -> Callable[[Fixes], Fixes]:
    """From a wrong place, as sure of it as ever."""

    def move(fix: GnssFix) -> GnssFix:
        if not begin_s <= fix.stamp_ns / SECOND_NS < end_s or not np.isfinite(fix.latitude_deg):
            return fix
        place = Datum(fix.latitude_deg, fix.longitude_deg, fix.height_m).geodetic(np.array([east_m, north_m, 0.0]))
        return replace(fix, latitude_deg=place[0], longitude_deg=place[1], height_m=place[2])

    return lambda fixes: [move(fix) for fix in fixes]


FOR_EVER = 1e9
CASES = (
    Case("none", lambda fixes: fixes),
    Case("no fix", lambda _: []),
    Case("first fix after ten minutes", between(600.0, FOR_EVER)),
    Case("fixes of the first minute only", between(0.0, 60.0)),
    Case("dropouts, spikes and offsets of 10 m, sigmas half of what is true", lambda fixes: fixes, "corrupted"),
    Case("sigmas a fifth of what is true", lambda fixes: fixes, "dishonest"),
    Case("delivered 2 s late", later(delivered_s=2.0)),
    Case("stamped 1 s late", later(stamped_s=1.0)),
    Case("36 m away for half a minute", elsewhere(30.0, -20.0, MIDDLE_S, MIDDLE_S + 30.0)),
    Case("36 m away from the middle on", elsewhere(30.0, -20.0, MIDDLE_S, FOR_EVER)),
)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where cast walks are kept")
    cache = parser.parse_args().cache
    world = build(scenario("loop_800", 1))
    odometry = tracked(world, cache)
    print("| fault | placed from, s | mean m | worst m | end m | stated m | outside | fixes used, rejected | said |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for case in CASES:
        print(f"| {case.name} | {row(case, world, odometry)} |", flush=True)


def row(case: Case, world: World, odometry: Odometry) -> str:
    """What the live fusion made of one fault."""
    fusion = GnssFusion()
    fixes = iter(sorted(case.fault(received(world, case.preset, 1)), key=lambda fix: fix.receive_ns))
    own = world.config.datum
    datum = Datum(own.latitude_deg, own.longitude_deg, own.height_m)
    fix, found = next(fixes, None), []
    for k, estimate in enumerate(odometry.estimates):
        fusion.add_odometry(estimate)
        while fix is not None and fix.receive_ns <= estimate.stamp_ns:
            fusion.add_fix(fix)
            fix = next(fixes, None)
        pose, state = fusion.global_pose(estimate), fusion.state()
        if pose is not None and state is not None and state.datum is not None:
            place = datum.enu(*Datum(*state.datum).geodetic(pose.position_enu_m))
            found.append((estimate.stamp_ns / SECOND_NS, place - odometry.truth_m[k], pose.covariance[:3, :3]))
    state = fusion.state()
    counts = "0, 0" if state is None else f"{state.fixes_used}, {state.fixes_rejected}"
    return f"{_figures(found)} | {counts} | {fusion.note or '-'}"


def _figures(found: Iterable[tuple[float, np.ndarray, np.ndarray]]) -> str:
    rows = list(found)
    if not rows:
        return "- | - | - | - | - | -"
    times, errors, covariances = (np.array(column) for column in zip(*rows, strict=True))
    size = np.linalg.norm(errors, axis=1)
    sigmas = np.sqrt(np.einsum("ni,ni->n", errors, np.linalg.solve(covariances, errors[..., None])[..., 0]))
    end = size[times > times[-1] - LAST_S].mean()
    stated = np.sqrt(np.trace(covariances[-1]))
    figures = " | ".join(f"{value:.1f}" for value in (size.mean(), size.max(), end, stated))
    return f"{times[0]:.0f} | {figures} | {(sigmas > OUTSIDE_SIGMAS).mean():.0%}"


if __name__ == "__main__":
    main()
