"""The graph finds the way that all of the data agree on, and says how well it knows it."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

pytest.importorskip("gtsam", reason="GTSAM has no wheel for this Python")

from pipeline.gnss.config import FusionConfig
from pipeline.gnss.geodesy import Datum
from pipeline.refinement.closure import Closure
from pipeline.refinement.config import ChainConfig, GnssConfig, RefinementConfig
from pipeline.refinement.constraints import Constraints, Guess, Pin, Stretch
from pipeline.refinement.errors import ConstraintsRefused, NothingToRefine
from pipeline.refinement.keyframes import keyframes
from pipeline.refinement.recognition import Proposal, Recognised
from pipeline.refinement.session import Problem, Session
from pipeline.refinement.solver import Solver
from pipeline.refinement.spread import placement
from tests.pipeline.refinement import walks

WHITE = FusionConfig(antenna_m=tuple(walks.ARM_M), correlation_s=0.0)
ONE_DRIFT = RefinementConfig(chain=ChainConfig(drift_scales=(1.0,)))


def problem(track, fixes, fusion, config, *asked):
    """Of one session."""
    return Problem((Session(track, fixes, fusion),), config, *asked)


def errors_m(track, solved, positions):
    """(n, 3) of every pose against the truth, through the datum that the solution chose."""
    placed = placement(track, solved)
    datum = Datum(*placed.datum)
    found, _ = placed.poses(track)
    return np.array([walks.DATUM.enu(*datum.geodetic(place)) for place in found]) - positions


def test_the_way_is_found_to_a_fraction_of_one_fix_and_its_covariance_is_honest():
    way = walks.circle()
    track = walks.odometry(*way)
    solved = Solver(problem(track, walks.fixes(*way), WHITE, ONE_DRIFT)).solve()
    errors = errors_m(track, solved, way[1])
    assert np.linalg.norm(errors, axis=1).mean() < 0.15
    assert len(solved.frames) < len(track) / 3
    squared = [
        e @ np.linalg.solve(c[:3, :3], e) for e, c in zip(errors, placement(track, solved).covariance, strict=True)
    ]
    assert 0.3 < np.mean(squared) / 3.0 < 2.5


def test_fixes_that_are_ten_metres_off_are_left_out_and_hardly_bend_the_way():
    way = walks.circle()
    track = walks.odometry(*way)
    wrong = walks.fixes(*way, off=(60.0, 75.0, np.array([8.0, -6.0, 0.0])))
    solved = Solver(problem(track, wrong, WHITE, ONE_DRIFT)).solve()
    seconds = solved.fixes.stamps_ns / 1e9
    off = (seconds >= 60.0) & (seconds <= 75.0)
    assert not solved.judged.used[off].any()
    assert solved.judged.used[~off].mean() > 0.95
    assert np.linalg.norm(errors_m(track, solved, way[1]), axis=1).max() < 0.5
    squared = RefinementConfig(ONE_DRIFT.chain, GnssConfig(kernel="squared", gate=0.0, learn=False))
    believed = Solver(problem(track, wrong, WHITE, squared)).solve()
    assert np.linalg.norm(errors_m(track, believed, way[1]), axis=1).max() > 1.0


@pytest.mark.parametrize("kernel", ["huber", "cauchy", "geman-mcclure", "tukey", "welsch"])
def test_every_kernel_bounds_a_wrong_fix_without_a_gate(kernel):
    way = walks.circle()
    track = walks.odometry(*way)
    wrong = walks.fixes(*way, off=(60.0, 64.0, np.array([8.0, -6.0, 0.0])))
    config = RefinementConfig(ONE_DRIFT.chain, GnssConfig(kernel=kernel, gate=0.0))
    solved = Solver(problem(track, wrong, WHITE, config)).solve()
    assert np.linalg.norm(errors_m(track, solved, way[1]), axis=1).max() < 0.7


def test_lasting_errors_are_not_averaged_away():
    way = walks.circle()
    track, heard = walks.odometry(*way), walks.fixes(*way)
    white = Solver(problem(track, heard, WHITE, ONE_DRIFT)).solve()
    lasting = msgspec.structs.replace(WHITE, correlation_s=20.0)
    correlated = Solver(problem(track, heard, lasting, ONE_DRIFT)).solve()
    ratio = correlated.covariance[:, 0, 0].mean() / white.covariance[:, 0, 0].mean()
    assert 3.0 < ratio < 60.0


def test_the_drift_that_explains_the_fixes_is_chosen():
    way = walks.circle(laps=2.0)
    track, heard = walks.odometry(*way, drift_m=0.1, drift_yaw_deg=0.1), walks.fixes(*way, sigma_m=0.2)
    honest = Solver(problem(track, heard, WHITE, RefinementConfig())).solve()
    track["covariance"] /= 64.0
    sure = Solver(problem(track, heard, WHITE, RefinementConfig())).solve()
    assert honest.drift_scale == 1.0
    assert sure.drift_scale >= 4.0


def test_a_false_closure_among_true_ones_does_not_fold_the_way():
    way = walks.circle(laps=2.0)
    track = walks.odometry(*way, drift_m=0.03)
    solver = Solver(problem(track, [], WHITE, ONE_DRIFT))
    frames = solver.frames
    true = [claim(frames, way, a, b) for a, b in ((2, 80), (20, 98), (40, 118))]
    wrong = claim(frames, way, 10, 50)
    wrong = Closure(wrong.a, wrong.b, np.eye(4), wrong.covariance)
    solved = solver.solve([*true, wrong])
    assert [(one.a, one.b) for one in solved.doubted] == [(10, 50)]
    assert len(solved.closures) == 3
    drifted = gap_m(solver.solve().poses.positions_m, frames, way)
    assert gap_m(solved.poses.positions_m, frames, way) < 0.5 * drifted


def claim(frames, way, a, b):
    """What is true between two keyframes, to 3 cm."""
    ends = []
    for key in (a, b):
        k = frames.index[key]
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = walks.turned(way[2][k]), way[1][k]
        ends.append(pose)
    return Closure(a, b, np.linalg.inv(ends[0]) @ ends[1], np.diag([0.003**2] * 3 + [0.03**2] * 3))


def gap_m(positions_m, frames, way):
    """How far two keyframes of the two laps are from what they are apart in truth."""
    a, b = 30, 108
    true = np.linalg.norm(way[1][frames.index[a]] - way[1][frames.index[b]])
    return abs(np.linalg.norm(positions_m[a] - positions_m[b]) - true)


def test_a_way_whose_odometry_was_lost_is_put_together_by_what_was_known_again():
    way = walks.circle(laps=2.0)
    track = walks.odometry(*way)
    late = np.arange(len(track)) >= len(track) // 2
    turn = walks.turned(2.0)
    track["position_m"][late] = track["position_m"][late] @ turn.T + [60.0, -35.0, 0.5]
    track["rotation"][late] = turn @ track["rotation"][late]
    track["covariance"][late] += np.diag([900.0] * 3 + [0.0, 0.0, 4.0])
    lost = problem(track, [], WHITE, ONE_DRIFT)
    frames = keyframes(track, ONE_DRIFT.chain)
    assert gap_m(Solver(lost).solve().poses.positions_m, frames, way) > 20.0
    claims = [claim(frames, way, a, b) for a, b in ((2, 80), (20, 98), (40, 118))]
    x_m, y_m, z_m = claims[0].pose[:3, 3].tolist()
    yaw_deg = float(np.degrees(np.arctan2(claims[0].pose[1, 0], claims[0].pose[0, 0])))
    guess = Guess(float(frames.seconds[2]), float(frames.seconds[80]), x_m, y_m, z_m, yaw_deg)
    known = Proposal(guess, Recognised(0, 1, 0.0, np.zeros(3), 20, 25, 60.0), confirmed=1)
    solved = Solver(replace(lost, recognised=(known,))).solve(claims)
    assert len(solved.closures) == 3
    assert gap_m(solved.poses.positions_m, frames, way) < 0.3


def test_a_pin_holds_its_point_and_dropped_fixes_are_gone():
    way = walks.circle()
    track = walks.odometry(*way)
    biased = walks.fixes(*way, off=(0.0, 1e9, np.array([2.0, 0.0, 0.0])))
    pins = [Pin(walks.PERIOD_S * k, *walks.DATUM.geodetic(way[1][k]), sigma_m=0.02) for k in (40, 160, 280)]
    pinned = Constraints(pin=tuple(pins), drop_gnss=(Stretch(100.0, 150.0),))
    solved = Solver(
        problem(track, biased, msgspec.structs.replace(WHITE, correlation_s=1000.0), ONE_DRIFT, pinned)
    ).solve()
    assert np.linalg.norm(errors_m(track, solved, way[1])[[40, 160, 280]], axis=1).max() < 0.15
    assert not ((solved.fixes.stamps_ns > 100e9) & (solved.fixes.stamps_ns < 150e9)).any()
    with pytest.raises(ConstraintsRefused, match="a pin needs a session that GNSS can place"):
        Solver(problem(track, [], WHITE, ONE_DRIFT, pinned))


def test_a_track_that_does_not_move_is_refused():
    with pytest.raises(NothingToRefine, match="a track of 1 poses"):
        Solver(problem(walks.odometry(*walks.circle())[:1], [], WHITE, ONE_DRIFT))
