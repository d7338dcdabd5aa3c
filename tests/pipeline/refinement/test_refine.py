"""Sessions are refined together where they belong together, and alone where they do not, which is said."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gtsam", reason="GTSAM has no wheel for this Python")
pytest.importorskip("small_gicp", reason="small_gicp is not installed")

from pipeline.gnss.config import FusionConfig
from pipeline.gnss.geodesy import Datum
from pipeline.products.track import estimate_of
from pipeline.refinement.config import ChainConfig, ClosureConfig, RecognitionConfig, RefinementConfig
from pipeline.refinement.constraints import Constraints, Guess, Pin
from pipeline.refinement.errors import ConstraintsRefused, NothingToRefine
from pipeline.refinement.refine import refine
from pipeline.refinement.session import Problem, Session
from pipeline.refinement.spread import placement
from pipeline.refinement.submaps import SubmapWriter, read_submaps
from tests.pipeline.refinement import walks
from tests.pipeline.refinement.test_registration import WILD, stand

WHITE = FusionConfig(antenna_m=tuple(walks.ARM_M), correlation_s=0.0)
CONFIG = RefinementConfig(chain=ChainConfig(drift_scales=(1.0,)))


def away(way, east_m):
    seconds, positions, yaw = way
    return seconds, positions + np.array([east_m, 0.0, 0.0]), yaw


def session(way, name, *, seed, fixes=True, submaps=()):
    track = walks.odometry(*way, seed=seed)
    return Session(track, walks.fixes(*way, seed=seed + 10) if fixes else [], WHITE, submaps, name)


def errors_m(found, number, way):
    track = found.problem.sessions[number].track
    placed = placement(track, found.solution.of(number))
    places, _ = placed.poses(track)
    return np.array([walks.DATUM.enu(*Datum(*placed.datum).geodetic(place)) for place in places]) - way[1]


def test_two_sessions_that_meet_have_one_datum_and_each_lies_where_it_was():
    ways = [walks.circle(), away(walks.circle(), 20.0)]
    given = tuple(session(way, name, seed=k) for k, (way, name) in enumerate(zip(ways, "ab", strict=True), 3))
    (found,) = refine(Problem(given, CONFIG))
    assert found.problem.names == ["a", "b"]
    datums = {placement(one.track, found.solution.of(k)).datum for k, one in enumerate(given)}
    assert len(datums) == 1
    for number, way in enumerate(ways):
        assert np.linalg.norm(errors_m(found, number, way), axis=1).mean() < 0.2


def test_sessions_that_do_not_meet_are_refined_alone_and_told_why():
    ways = {"a": walks.circle(), "b": away(walks.circle(), 20.0), "far": away(walks.circle(), 500.0)}
    given = [session(way, name, seed=k) for k, (name, way) in enumerate(ways.items(), 3)]
    given.append(session(walks.circle(), "blind", seed=9, fixes=False))
    found = refine(Problem(tuple(given), CONFIG))
    assert [one.problem.names for one in found] == [["a", "b"], ["far"], ["blind"]]
    assert "far was refined alone: it does not come within 30 m" in found[1].notes[0]
    assert "blind was refined alone: GNSS does not place it" in found[2].notes[0]


@pytest.mark.parametrize("joined_by", ["stems", "closure"])
def test_a_session_without_fixes_is_joined_by_its_stems_or_by_a_closure_that_names_it(tmp_path, joined_by):
    """The second carrier walks a part of the same way, another day; the guess is half a metre off."""
    way = walks.circle(radius_m=12.0)
    later = tuple(part[40:66] for part in way)
    given = []
    for name, walked, fixes in (("a", way, True), ("b", (later[0] - later[0][0], *later[1:]), False)):
        one = session(walked, name, seed=len(given) + 3, fixes=fixes)
        write_submaps(tmp_path / name, one.track, walked, seed=len(given))
        given.append(Session(one.track, one.fixes, WHITE, read_submaps(tmp_path / name), name))
    guess = Guess(25.0, 5.0, x_m=0.4, y_m=-0.3, a="a", b="b")
    asked = Constraints(closure=(guess,) if joined_by == "closure" else ())
    known = RecognitionConfig(enabled=joined_by == "stems")
    config = RefinementConfig(CONFIG.chain, closures=ClosureConfig(each=1), recognition=known)
    (found,) = refine(Problem(tuple(given), config, asked))
    assert found.problem.names == ["a", "b"]
    assert found.solution.closures
    origins = {one.candidate.origin for one in found.verdicts if one.sound}
    assert joined_by in origins if joined_by == "stems" else "stems" not in origins
    assert np.linalg.norm(errors_m(found, 1, later), axis=1).mean() < 0.3


def write_submaps(folder, track, way, seed):
    """What was seen from each pose of a way, in the `odom` of its track."""
    writer, world = SubmapWriter(folder), stand(WILD, seed)[::3]
    _, positions, yaw = way
    for k in range(len(track)):
        near = world[np.linalg.norm(world[:, :2] - positions[k, :2], axis=1) < 15.0]
        body = (near - positions[k]) @ walks.turned(yaw[k])
        cloud = body @ track["rotation"][k].T + track["position_m"][k]
        writer.add(estimate_of(track[k]), cloud.astype(np.float32), k)
    writer.close()


def test_constraints_of_several_sessions_name_theirs():
    given = tuple(session(walks.circle(), name, seed=3) for name in "ab")
    with pytest.raises(ConstraintsRefused, match="that names no session: there are a, b"):
        refine(Problem(given, CONFIG, Constraints(closure=(Guess(1.0, 2.0),))))
    with pytest.raises(ConstraintsRefused, match="of session 'c': there are a, b"):
        refine(Problem(given, CONFIG, Constraints(closure=(Guess(1.0, 2.0, a="a", b="c"),))))


def test_a_minute_without_recording_is_told_and_bridged_by_the_fixes():
    way = walks.circle(laps=2.0)
    keep = (way[0] < 60.0) | (way[0] >= 120.0)
    track, fixes = walks.odometry(*way)[keep], walks.fixes(*way)
    late = track["stamp_ns"] > 100e9
    track["position_m"][late] += [4.0, -3.0, 0.0]
    track["covariance"][late, :3, :3] += 25.0 * np.eye(3)
    (found,) = refine(Problem((Session(track, fixes, WHITE),), CONFIG))
    assert "no poses for 60 s after 60 s" in found.notes[0]
    walked = tuple(part[keep] for part in way)
    assert np.linalg.norm(errors_m(found, 0, walked), axis=1).mean() < 0.2


def test_a_pin_that_contradicts_the_others_is_named():
    way = walks.circle()
    pins = [Pin(walks.PERIOD_S * k, *walks.DATUM.geodetic(way[1][k])) for k in (40, 160)]
    wrong = Pin(walks.PERIOD_S * 100, *walks.DATUM.geodetic(way[1][100] + [2.0, 0.0, 0.0]))
    given = Session(walks.odometry(*way), walks.fixes(*way), WHITE)
    (right,) = refine(Problem((given,), CONFIG, Constraints(pin=tuple(pins))))
    assert not any("pin" in note for note in right.notes)
    (found,) = refine(Problem((given,), CONFIG, Constraints(pin=(*pins, wrong))))
    assert any("the pin at 50 s is missed by" in note for note in found.notes)


def test_an_empty_session_is_named():
    given = (session(walks.circle(), "a", seed=3), Session(walks.odometry(*walks.circle())[:0], [], WHITE, (), "none"))
    with pytest.raises(NothingToRefine, match="none: a track of 0 poses"):
        refine(Problem(given, CONFIG))
