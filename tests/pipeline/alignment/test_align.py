import numpy as np
import pytest

from benchmarks.alignment.stands import from_the_air, from_the_ground, grow, write_las
from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.search import Candidate
from pipeline.alignment.task import Task, run
from pipeline.alignment.transform import Transform
from pipeline.alignment.verdict import chance_nats

OFF = Transform((500_001.0, 5_400_002.0), 3.2, -4.1, 1.7, 9.0)
SEARCH = AlignmentConfig(search_m=7.0, search_deg=15.0)


def aligned(folder, stand, config=SEARCH, *, crowns, radius_m=20.0):
    air = write_las(folder / "air.laz", from_the_air(stand))
    ground = write_las(folder / "ground.laz", from_the_ground(stand, radius_m, OFF, crowns=crowns))
    return run(Task(air, ground, config), lambda _: lambda _: None).alignment


def error(found):
    """Metres at the middle of the stand, metres up, degrees."""
    here = np.array([[500_000.0, 5_400_000.0, 0.0]])
    off = (found.transform.apply(here) - OFF.apply(here))[0]
    return np.hypot(*off[:2]), off[2], found.transform.yaw_deg - OFF.yaw_deg


@pytest.mark.parametrize("crowns", [True, False])
def test_a_map_of_stems_and_ground_finds_its_place_under_the_crowns(tmp_path, crowns):
    found = aligned(tmp_path, grow("mixed", 1, side_m=80.0), crowns=crowns)
    metres, up, degrees = error(found)
    assert found.sure, found.doubts
    assert metres < 0.5
    assert abs(up) < 0.2
    assert abs(degrees) < 1.5
    assert metres < 4 * np.sqrt(np.linalg.eigvalsh(found.covariance[:2, :2])[-1])


def test_the_published_method_finds_it_too(tmp_path):
    config = AlignmentConfig(search_m=7.0, search_deg=15.0, method="nmi")
    metres, _, degrees = error(aligned(tmp_path, grow("mixed", 1, side_m=90.0), config, crowns=False, radius_m=25.0))
    assert metres < 1.0
    assert abs(degrees) < 4.0


def test_rows_of_a_flat_plantation_are_not_enough_to_tell(tmp_path):
    found = aligned(tmp_path, grow("rows", 2, side_m=70.0, relief_m=0.0), crowns=False, radius_m=15.0)
    assert any("another pose" in doubt for doubt in found.doubts)


def test_a_handful_of_stems_is_not_enough_to_tell(tmp_path):
    stand = grow("mixed", 3, side_m=80.0, relief_m=0.0)
    air = write_las(tmp_path / "air.laz", from_the_air(stand))
    table = tmp_path / "stems.csv"
    few = stand.trees[np.hypot(*(stand.trees[:, :2] - stand.middle_m).T) < 6.0][:7]
    table.write_text("x,y\n" + "\n".join(f"{x:.2f},{y:.2f}" for x, y in few[:, :2]))
    found = run(Task(air, table, SEARCH), lambda _: lambda _: None).alignment
    assert any("stems and nothing else" in doubt for doubt in found.doubts)


def test_another_stand_is_not_taken_for_this_one(tmp_path):
    air = write_las(tmp_path / "air.laz", from_the_air(grow("mixed", 4, side_m=80.0, relief_m=0.0)))
    other = from_the_ground(grow("mixed", 5, side_m=80.0, relief_m=0.0), 20.0, OFF, crowns=False)
    ground = write_las(tmp_path / "ground.laz", other)
    assert not run(Task(air, ground, SEARCH), lambda _: lambda _: None).alignment.sure


def walked(folder, stand, at_m, radius_m):
    """Two walks of which the second lies in a local frame, and the transform that is looked for."""
    local = Transform((500_000.0, 5_400_000.0), 500_000.0, 5_400_000.0, 480.0, 140.0)
    first = write_las(folder / "monday.laz", from_the_ground(stand, radius_m, OFF, crowns=False), None)
    seen = from_the_ground(stand, radius_m, local, crowns=False, at_m=at_m, walk=1, missed=0.1)
    done = run(
        Task(first, write_las(folder / "tuesday.laz", seen, None), AlignmentConfig(), sessions=True),
        lambda _: lambda _: None,
    )
    into = done.alignment.transform.after(done.placed.start)
    return done.alignment, into.apply(seen[::50]), OFF.inverse().apply(local.apply(seen[::50]))


def test_two_walks_in_one_stand_find_each_other_without_any_coordinates(tmp_path):
    found, moved, expected = walked(tmp_path, grow("mixed", 6, side_m=60.0), (9.0, 5.0), 14.0)
    assert found.sure, found.doubts
    assert np.abs(moved - expected).max() < 0.4


@pytest.mark.slow
def test_two_walks_that_share_no_place_are_refused(tmp_path):
    found, *_ = walked(tmp_path, grow("mixed", 0, side_m=90.0), (30.0, 10.0), 14.0)
    assert any("another pose" in doubt for doubt in found.doubts)


def test_two_walks_along_the_rows_of_a_plantation_are_refused(tmp_path):
    found, *_ = walked(tmp_path, grow("rows", 2, side_m=60.0, relief_m=0.0), (6.0, 2.0), 12.0)
    assert any("another pose" in doubt for doubt in found.doubts)


@pytest.mark.parametrize(("scale", "count", "expected"), [(3.0, 400, 3.0), (0.5, 400, 1.0), (3.0, 15, 1.0)])
def test_what_chance_answers_lie_apart_is_the_scale_of_their_tail(scale, count, expected):
    random = np.random.default_rng(12)
    drawn = np.sort(random.exponential(scale, (200, count)))[:, ::-1]
    places = random.uniform(-2000, 2000, (count + 1, 2)).tolist()
    right = Candidate(*places[0], 0.0, 99.0)
    found = [
        chance_nats(
            [right, *(Candidate(*at, 0.0, n) for at, n in zip(places[1:], nats.tolist(), strict=True))],
            AlignmentConfig(),
        )
        for nats in drawn
    ]
    assert np.mean(found) == pytest.approx(expected, rel=0.1)


def test_a_transform_and_its_inverse_leave_nothing():
    points = np.random.default_rng(1).normal(size=(20, 3)) * 50 + [500_000, 5_400_000, 300]
    second = Transform((499_990.0, 5_400_020.0), -1.0, 0.5, 0.2, 170.0)
    np.testing.assert_allclose(OFF.inverse().apply(OFF.apply(points)), points, atol=1e-8)
    np.testing.assert_allclose(second.after(OFF).apply(points), second.apply(OFF.apply(points)), atol=1e-8)
    np.testing.assert_allclose(OFF.about((0.0, 0.0)).apply(points), OFF.apply(points), atol=1e-6)
    whole = np.column_stack([points, np.ones(20)]) @ OFF.matrix().T
    np.testing.assert_allclose(whole[:, :3], OFF.apply(points), atol=1e-6)
