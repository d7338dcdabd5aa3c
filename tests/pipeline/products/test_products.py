"""Products are what other programs read out of them."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import laspy
import numpy as np
import pyproj
import pytest

from pipeline.estimates import OdometryEstimate
from pipeline.gnss.geodesy import Datum
from pipeline.products.earth import Site
from pipeline.products.findings import PointEvidence
from pipeline.products.laz import MapSource, adjusted_gps_s, write_laz
from pipeline.products.plots import Line, Plot, thinned, ticks
from pipeline.products.simplify import simplified
from pipeline.products.tiles import TileStore, read_tile, tiles
from pipeline.products.track import Placement, TrackWriter, estimate_of, read_track
from pipeline.products.tum import write_tum

DATUM = (40.057, -75.218, 60.0)
SITE = Site(DATUM)
START_NS = 1_790_000_000_123_456_789


def estimate(k: int) -> OdometryEstimate:
    weak = np.eye(3)[:1] if k == 2 else np.empty((0, 3))
    zero = np.zeros(3)
    return OdometryEstimate(
        *(START_NS + k * 10**8, np.array([k, 2.0, 3.0]), np.eye(3), zero, np.eye(6) * k, zero, zero, float(k)),
        *(k == 2, weak, 100 + k, 90, "weak across" if k == 2 else ""),
    )


def test_a_track_comes_back_as_it_was_written_and_without_a_torn_end(tmp_path):
    with TrackWriter(tmp_path / "t") as track:
        for k in range(4):
            track.add(estimate(k))
    path = tmp_path / "t"
    path.write_bytes(path.read_bytes()[:-5])
    records = read_track(path)
    assert len(records) == 3
    back, original = estimate_of(records[2]), estimate(2)
    assert (back.stamp_ns, back.note, back.degenerate, back.points) == (original.stamp_ns, "weak across", True, 102)
    np.testing.assert_array_equal(back.weak_directions, original.weak_directions)
    np.testing.assert_array_equal(back.covariance, original.covariance)


def test_tum_keeps_nanoseconds(tmp_path):
    half = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    write_tum(tmp_path / "a.tum", np.array([START_NS]), np.array([[1.0, 2.0, 3.0]]), half[None])
    words = (tmp_path / "a.tum").read_text().split()
    assert words[0] == "1790000000.123456789"
    np.testing.assert_allclose([float(word) for word in words[1:]], [1, 2, 3, 0, 0, 0.5**0.5, 0.5**0.5], atol=1e-8)


@pytest.mark.parametrize(
    ("datum", "epsg"), [(DATUM, 32618), ((-33.9, 18.4, 0.0), 32734), ((47.0, 179.999, 0.0), 32660)]
)
def test_points_on_the_earth_agree_with_the_closed_form_and_with_the_projection(datum, epsg):
    site, oracle = Site(datum), Datum(*datum)
    assert site.epsg == epsg
    enu = np.array([[0.0, 0.0, 0.0], [812.0, -431.0, 25.0], [-5000.0, 9000.0, 120.0]])
    geodetic = site.geodetic(enu)
    for row, point in zip(geodetic, enu, strict=True):
        latitude, longitude, height = oracle.geodetic(point)
        np.testing.assert_allclose(row, [longitude, latitude, height], atol=1e-8)
    east, north = pyproj.Proj(f"EPSG:{epsg}")(geodetic[:, 0], geodetic[:, 1])
    np.testing.assert_allclose(site.utm(enu)[:, :2], np.column_stack([east, north]), atol=1e-4)


def test_the_affine_shortcut_is_exact_to_a_millimetre_within_a_tile():
    around = np.array([3000.0, -2000.0, 40.0])
    points = around + np.random.default_rng(1).uniform(-40, 40, (200, 3))
    np.testing.assert_allclose(SITE.utm_nearby(points), SITE.utm(points), atol=5e-4)


def walk(count: int = 50) -> tuple[np.ndarray, np.ndarray]:
    angles = np.linspace(0, np.pi, count)
    stamps = START_NS + np.arange(count) * 10**8
    return stamps, np.column_stack([20 * np.cos(angles), 20 * np.sin(angles), np.linspace(0, 2, count)])


def test_a_simpler_line_is_never_farther_off_than_allowed():
    _, points = walk(500)
    kept = simplified(points, 0.05)
    assert 5 < len(kept) < 100
    # Oracle: brute force over all segments of the simpler line.
    line = points[kept]
    for point in points:
        steps = np.linspace(0, 1, 50)[:, None, None]
        near = line[:-1] + steps * (line[1:] - line[:-1])
        assert np.linalg.norm(near - point, axis=2).min() < 0.06


def cloud(around, count: int = 3000, seed: int = 0) -> np.ndarray:
    points = np.random.default_rng(seed).uniform(-6, 6, (count, 4))
    points[:, :3] += around
    points[:, 3] = 20.0
    points[:5, 3] = 200.0
    return points.astype(np.float32)


def test_tiles_are_the_same_however_little_memory_there_is(tmp_path):
    found = []
    for name, budget in (("roomy", 1 << 30), ("tight", 100_000)):
        store = TileStore(tmp_path / name, 8.0, 0.5, budget)
        for sweep in range(20):
            store.add(cloud((sweep * 1.5, 0.0, 0.0), seed=sweep), sweep)
        store.close()
        found.append({tile: read_tile(tmp_path / name, tile, 0.5) for tile in tiles(tmp_path / name)})
    assert found[0].keys() == found[1].keys()
    for tile, points in found[0].items():
        np.testing.assert_array_equal(np.sort(points, order=["sweep"])["sweep"], points["sweep"])
        assert set(map(bytes, points)) == set(map(bytes, found[1][tile]))
    everything = np.concatenate(list(found[0].values()))
    dull = everything[everything["intensity"] < 150]
    cells = np.floor(dull["xyz"] / 0.5).astype(int)
    assert len(np.unique(cells, axis=0)) == len(dull)
    assert (everything["intensity"] == 200).sum() > 60


def source(folder: Path, placement: Placement | None) -> MapSource:
    store = TileStore(folder, 8.0, 0.05)
    for sweep in range(3):
        store.add(cloud((sweep * 4.0, 0.0, 0.0), 500, sweep), sweep)
    store.close()
    return MapSource(folder, 0.05, START_NS + np.arange(3) * 10**8, np.array([0.1, 0.2, 0.3]), placement, "walk")


def test_the_map_is_laz_with_crs_time_intensity_and_sigma(tmp_path):
    yaw = 0.3
    placement = Placement.upright(DATUM, np.array([[5.0, 6.0, 7.0]] * 3), np.full(3, yaw), np.zeros((3, 6, 6)))
    count = write_laz(tmp_path / "map.laz", [source(tmp_path / "tiles", placement)], lambda _: None)
    read = laspy.read(tmp_path / "map.laz")
    assert (str(read.header.version), read.header.point_format.id, len(read.points)) == ("1.4", 6, count)
    assert read.header.parse_crs().to_epsg() == 32618
    expected = np.vstack([cloud((k * 4.0, 0.0, 0.0), 500, k)[:, :3] for k in range(3)]).astype(float)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    expected = SITE.utm(expected @ turn.T + [5.0, 6.0, 7.0])
    assert count == len(expected)
    from scipy.spatial import cKDTree  # noqa: PLC0415

    distances, _ = cKDTree(expected).query(read.xyz)
    assert distances.max() < 0.002
    last = read.sweep == 2
    np.testing.assert_allclose(read.sigma_m[last], 0.3)
    np.testing.assert_allclose(read.gps_time[last], adjusted_gps_s(np.array([START_NS + 2 * 10**8]))[0])
    assert set(np.unique(read.intensity)) == {20 * 257, 200 * 257}


def test_gps_time_of_a_known_instant():
    # 2020-01-01T00:00:00Z is GPS second 1261872018.
    assert adjusted_gps_s(np.array([1_577_836_800_000_000_000]))[0] == 1_261_872_018 - 1_000_000_000


def test_what_the_camera_made_of_each_point_is_in_the_map(tmp_path):
    asked = []

    def evidence(tile, points):
        asked.append((tile, len(points)))
        seen = (points["sweep"] != 1).astype(np.uint16) * 7
        heat = np.where(seen > 0, points["xyz"][:, 0] > 2, np.nan).astype(np.float32)
        return PointEvidence(heat, (heat > 0.5).astype(np.uint8), seen)

    plain = source(tmp_path / "tiles", None)
    count = write_laz(tmp_path / "map.laz", [replace(plain, evidence=evidence)], lambda _: None)
    read = laspy.read(tmp_path / "map.laz")
    assert sum(points for _, points in asked) == count
    assert [tile for tile, _ in asked] == tiles(tmp_path / "tiles")
    np.testing.assert_array_equal(np.array(read.heat), np.where(read.sweep == 1, -1.0, read.x > 2))
    np.testing.assert_array_equal(np.array(read.label), (read.sweep != 1) & (read.x > 2))
    np.testing.assert_array_equal(np.array(read.seen), np.where(read.sweep == 1, 0, 7))
    # LAS 1.4 R15, table 24: options a byte before the name, the value for "none" 36 bytes after its begin.
    raw = (tmp_path / "map.laz").read_bytes()
    at = raw.index(b"heat\0")
    assert (raw[at - 1], struct.unpack_from("<d", raw, at + 36)) == (0b1, (-1.0,))
    write_laz(tmp_path / "plain.laz", [plain], lambda _: None)
    assert "heat" not in laspy.read(tmp_path / "plain.laz").point_format.extra_dimension_names


def test_points_of_several_sessions_tell_which_they_are_of(tmp_path):
    placement = Placement.upright(DATUM, np.zeros((3, 3)), np.zeros(3), np.zeros((3, 6, 6)))
    first = source(tmp_path / "tiles", placement)
    count = write_laz(tmp_path / "map.laz", [replace(first, number=1), replace(first, number=2)], lambda _: None)
    read = laspy.read(tmp_path / "map.laz")
    assert np.bincount(read.point_source_id).tolist() == [0, count // 2, count // 2]
    assert b"walk (point source 1), walk (point source 2)" in (tmp_path / "map.laz").read_bytes()


def test_a_local_map_has_no_crs_and_says_why(tmp_path):
    write_laz(tmp_path / "map.laz", [source(tmp_path / "tiles", None)], lambda _: None)
    read = laspy.read(tmp_path / "map.laz")
    assert read.header.parse_crs() is None
    text = next(vlr for vlr in read.header.vlrs if vlr.record_id == 3)
    assert b"coordinates are local" in text.record_data
    plain, shift = np.array(read.xyz), np.array([[5.0, 6.0, 7.0]] * 3)
    refined = Placement.upright(None, shift, np.full(3, np.pi / 2), np.zeros((3, 6, 6)))
    write_laz(tmp_path / "refined.laz", [source(tmp_path / "again", refined)], lambda _: None)
    read = laspy.read(tmp_path / "refined.laz")
    assert read.header.parse_crs() is None
    np.testing.assert_allclose(read.xyz, plain @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]] + shift[0], atol=0.0011)


def test_plots_keep_peaks_and_label_round_values():
    assert ticks(-0.3, 2.2, 5) == [0.0, 0.5, 1.0, 1.5, 2.0]
    x = np.arange(50_000.0)
    y = np.zeros_like(x)
    y[33_333] = 9.0
    assert thinned(x, y, 1600)[1].max() == 9.0
    assert len(thinned(x, y, 1600)[0]) <= 1700
    svg = Plot("seconds", "a < b", [Line(x, y, "x & y")], bands=[(5.0, 9.0)]).svg()
    assert ElementTree.fromstring(svg).tag == "svg"
    assert "NaN" not in Plot("x", "y", [Line(np.array([0.0, np.nan, 2.0]), np.array([1.0, 2.0, np.nan]), "")]).svg()
    Plot("x", "y", [Line(np.empty(0), np.empty(0), "")], equal=True).svg()
