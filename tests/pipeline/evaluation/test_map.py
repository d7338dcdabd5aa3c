"""A small stand as a map: what is put wrong into it on purpose is what comes out."""

from __future__ import annotations

import laspy
import numpy as np
import pytest

from pipeline.evaluation.control import ControlPoint
from pipeline.evaluation.errors import EvaluationError
from pipeline.evaluation.map import Asked, map_quality
from pipeline.evaluation.map_store import CELL_M, MapStore
from pipeline.inventory.map_file import open_map
from pipeline.inventory.source import Part

EAST, NORTH, UP = 500_000.0, 4_400_000.0, 60.0
NOISE_M = 0.015


def stand(*, pass_up_m=0.0, seed=3):
    """Ground and two stems, walked past twice, 100 s apart: (n, 3) and times (n,)."""
    rng = np.random.default_rng(seed)
    parts, times = [], []
    for begin_s, up_m in ((0.0, 0.0), (100.0, pass_up_m)):
        ground = np.column_stack([rng.uniform(0.0, 10.0, (8000, 2)), rng.normal(up_m, NOISE_M, 8000)])
        stems = []
        for x, y, radius in ((4.0, 4.0, 0.18), (8.0, 7.0, 0.25)):
            turn, height = rng.uniform(0.0, 2 * np.pi, 3000), rng.uniform(0.0, 6.0, 3000)
            away = radius + rng.normal(0.0, NOISE_M, 3000)
            stems.append(np.column_stack([x + away * np.cos(turn), y + away * np.sin(turn), height + up_m]))
        some = np.vstack([ground, *stems])
        parts.append(some)
        times.append(begin_s + rng.uniform(0.0, 10.0, len(some)))
    order = np.argsort(np.concatenate(times), kind="stable")
    return np.vstack(parts)[order] + (EAST, NORTH, UP), np.concatenate(times)[order]


def written(path, xyz, time_s=None):
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.full(3, 0.001), np.floor(xyz[0])
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz.T
    if time_s is not None:
        cloud.gps_time = 1e9 + time_s
    cloud.write(path)
    return open_map(path)


@pytest.fixture(scope="module")
def quality(tmp_path_factory):
    folder = tmp_path_factory.mktemp("maps")
    xyz, time_s = stand(pass_up_m=0.06)
    reference, _ = stand(seed=4)
    points = [
        ControlPoint("A", EAST + 6.0, NORTH + 2.0, UP - 0.1),
        ControlPoint("B", EAST + 2.0, NORTH + 9.0, UP - 0.1),
    ]
    source = written(folder / "map.laz", xyz, time_s)
    beside = written(folder / "reference.laz", reference - (0.0, 0.0, 0.2))
    shares = []
    found = map_quality(source, Asked(control=points, places=2000), beside, shares.append)
    assert shares == sorted(shares)
    return found


def test_passes_are_as_far_apart_as_they_were_put(quality):
    assert quality.overlap.up_m == pytest.approx(0.06, abs=0.01)
    assert quality.overlap.places > 500
    assert 0.04 < quality.overlap.median_m < 0.08


def test_the_reference_is_as_far_away_as_it_was_put(quality):
    assert quality.reference.up_m == pytest.approx(0.2 + 0.03, abs=0.02)  # the map's passes are 0 and 6 cm up


def test_control_points_tell_the_height_of_the_map(quality):
    assert quality.control.up_bias_m == pytest.approx(0.1 + 0.03, abs=0.03)
    assert [one.name for one in quality.control.points] == ["A", "B"]


def test_bark_is_as_thick_as_its_noise(quality):
    assert quality.bark.stems == 2
    assert quality.bark.thickness_m == pytest.approx(NOISE_M, rel=0.25)


def test_without_times_there_are_no_passes_and_a_reference_elsewhere_is_refused(tmp_path):
    xyz, _ = stand()
    source = written(tmp_path / "map.laz", xyz[::4])
    found = map_quality(source, Asked(places=2000))
    assert (found.overlap.places, found.overlap.why) == (
        0,
        "the points carry no time, and no number of their recording",
    )
    assert found.reference is None
    assert found.control is None
    assert 0.01 < found.sharpness.surface_m < 0.03
    with pytest.raises(EvaluationError, match=r"far\.laz lies beside map\.laz: are both in the same coordinates"):
        map_quality(source, Asked(), written(tmp_path / "far.laz", xyz[::4] + np.array([500.0, 0.0, 0.0])))
    with pytest.raises(EvaluationError, match=r"Q at 3\.0 4\.0 is not on the map, which goes from 500000"):
        map_quality(source, Asked(control=[ControlPoint("Q", 3.0, 4.0, 5.0)]))


def test_a_cell_is_read_with_its_margin_and_each_point_is_chosen_once(tmp_path):
    rng = np.random.default_rng(5)
    xyz = rng.uniform(-2 * CELL_M, 2 * CELL_M, (3000, 3)).astype(np.float32)
    store = MapStore(tmp_path)
    for some in np.array_split(xyz, 7):
        store.add(Part(some, np.zeros(len(some), np.bool_), time_s=np.full(len(some), 5e8)), 3)
    store.add(Part(xyz[:10], np.zeros(10, np.bool_)), 0, np.array([1.0, 0.0, 0.0]))
    store.flush()
    chosen = np.concatenate([points["xyz"][points["chosen"]] for _, points in store.cells(0.5)])
    assert sorted(map(tuple, chosen)) == sorted(map(tuple, xyz[::3]))
    for _, points in store.cells(0.5):
        low, high = points["xyz"][:, :2].min(axis=0), points["xyz"][:, :2].max(axis=0)
        assert (high - low <= CELL_M + 1.0).all()
    near = store.near(np.array([0.1, -0.2]), 3.0)["xyz"]
    assert len(near) == np.count_nonzero(np.hypot(*(xyz[:, :2] - (0.1, -0.2)).T) <= 3.0)
