from dataclasses import replace

import numpy as np
import pyproj
import pytest

from pipeline.alignment.cloud import Cloud, batches, inspect
from pipeline.alignment.errors import AlignmentError, ApartError, CloudError, FrameError
from pipeline.alignment.frames import check_heights, place
from pipeline.alignment.grid import Grid
from pipeline.alignment.scene import terrestrial_scene
from pipeline.alignment.stem_table import read_stems
from pipeline.alignment.surface import Surface
from pipeline.alignment.transform import Transform

RANDOM = np.random.default_rng(8)
UTM = pyproj.CRS.from_epsg(32633)


def cloud(path, low=(500_000, 5_400_000, 400), size=50.0, crs=UTM):
    return Cloud(path, 1000, np.array(low, float), np.array(low, float) + size, crs)


@pytest.fixture
def air(tmp_path):
    return cloud(tmp_path / "air.laz", size=100.0)


@pytest.mark.parametrize(
    "case",
    [
        ((5_400_010, 500_010, 0), None, FrameError, "axes are swapped"),
        ((500_010 / 0.3048, 5_400_010 / 0.3048, 0), None, FrameError, "taken for feet"),
        ((0, 0, 0), None, ApartError, "--start"),
        ((500_900, 5_400_010, 0), UTM, ApartError, "0.8 km"),
        ((15.0, 48.7, 0), pyproj.CRS.from_epsg(4326), FrameError, "in degrees"),
        ((500_010, 5_400_010, 0), pyproj.CRS.from_epsg(2225), FrameError, "US survey foot"),
    ],
)
def test_a_map_in_the_wrong_frame_is_refused_with_the_reason(air, tmp_path, case):
    low, crs, error, says = case
    with pytest.raises(error, match=says):
        place(air, cloud(tmp_path / "ground.laz", low, crs=crs), None, 10.0)


def test_heights_in_feet_are_refused():
    trees = np.full((40, 40), 27.0)
    check_heights("air.laz", trees)
    with pytest.raises(FrameError, match="27 m if its heights are in feet"):
        check_heights("air.laz", trees / 0.3048)


def test_a_map_in_another_zone_is_converted_and_a_local_one_started(air, tmp_path):
    there = pyproj.Transformer.from_crs(32633, 32632, always_xy=True)
    corner = there.transform(500_020.0, 5_400_020.0)
    placed = place(air, cloud(tmp_path / "g.laz", (*corner, 0), 30.0, pyproj.CRS.from_epsg(32632)), None, 10.0)
    np.testing.assert_allclose(placed.points(np.array([[*corner, 7.0]])), [[500_020, 5_400_020, 7]], atol=1e-3)
    assert "converted" in placed.notes[0]
    start = Transform((0.0, 0.0), 500_050, 5_400_050, 0.0, 90.0)
    placed = place(air, cloud(tmp_path / "g.laz", (-10, -10, 0), 20.0, None), start, 10.0)
    np.testing.assert_allclose(placed.points(np.array([[3.0, 1.0]])), [[500_049, 5_400_053]])


@pytest.mark.parametrize("text", [True, False])
def test_ply_gives_the_points_that_were_written(tmp_path, text):
    points = RANDOM.normal(size=(700, 3)).round(4)
    path = tmp_path / "map.ply"
    kind = np.dtype([("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("red", "u1")])
    rows = np.zeros(700, kind)
    for axis, values in zip("xyz", points.T, strict=True):
        rows[axis] = values
    head = f"ply\nformat {'ascii' if text else 'binary_little_endian'} 1.0\nelement vertex 700\n"
    head += "property double x\nproperty double y\nproperty double z\nproperty uchar red\nend_header\n"
    body = "\n".join(" ".join(map(str, row.tolist())) for row in rows).encode() if text else rows.tobytes()
    path.write_bytes(head.encode() + body)
    found = inspect(path)
    assert found.count == 700
    read = np.concatenate([batch.xyz_m for batch in batches(found, at_once=300)])
    np.testing.assert_allclose(read, points)
    if not text:
        path.write_bytes(path.read_bytes()[:-100])
        with pytest.raises(CloudError, match="ends after"):
            inspect(path)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("map.ply", b"solid stl", "does not begin"),
        ("map.laz", b"not a cloud at all" * 40, "no sound LAS"),
        ("stems.csv", b"a,b\n1,2\n", "no column x"),
        ("stems.csv", b"x,y\n1,two\n", "stems.csv:2: 'two'"),
        ("stems.csv", b"x,y\n", "holds no stems"),
    ],
)
def test_a_broken_file_is_named_with_what_is_wrong(tmp_path, name, content, says):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(AlignmentError, match=says):
        read_stems(path) if path.suffix == ".csv" else inspect(path)


def test_thick_stems_have_more_say_and_unknown_ones_the_usual(tmp_path):
    path = tmp_path / "stems.csv"
    path.write_text("easting,northing,dbh_m\n1,2,0.10\n3,4,0.30\n5,6,\n7,8,0.20\n")
    assert read_stems(path).weights.tolist() == pytest.approx([0.5, 1.5, 1.0, 1.0])
    assert len(read_stems(path, least_dbh_cm=15.0).places_m) == 3


def made_map():
    """A slope with three stems, a bush, a crown that hides the ground, and stray echoes below it."""
    floor = RANDOM.uniform(0, 20, (20_000, 2))
    floor = floor[np.hypot(*(floor - [15, 15]).T) > 1.5]
    stems = np.array([[4.0, 4.0], [10.0, 12.0], [15.0, 6.0]])
    parts = [np.column_stack([floor, 0.3 * floor[:, 0]])]
    for x, y in stems:
        turn, up = RANDOM.uniform(0, 6.28, 400), RANDOM.uniform(0, 8, 400)
        parts.append(np.column_stack([x + 0.15 * np.cos(turn), y + 0.15 * np.sin(turn), 0.3 * x + up]))
    bush = RANDOM.uniform(-1.5, 1.5, (900, 2)) + np.array([5.0, 14.0])
    parts.append(np.column_stack([bush, 0.3 * bush[:, 0] + RANDOM.uniform(0.2, 2.2, 900)]))
    crown = RANDOM.uniform(-1.5, 1.5, (600, 2)) + np.array([15.0, 15.0])
    parts.append(np.column_stack([crown, 0.3 * crown[:, 0] + RANDOM.uniform(8, 9, 600)]))
    parts.append(np.array([[9.0, 3.0, -7.0], [2.0, 17.0, -5.0]]))
    return np.concatenate(parts), stems


def test_ground_canopy_and_stems_of_a_ground_map(tmp_path):
    points, stems = made_map()
    zeros = np.zeros(len(points))
    one = next(iter(batches(cloud_of(tmp_path, points))))
    scene = terrestrial_scene(lambda: [replace(one, xyz_m=points, kind=zeros.astype(np.uint8))], grid_of(points))
    inner = scene.terrain_m[4:-4, 4:-4] - 0.3 * scene.grid.centres_m()[4:-4, 4:-4, 0]
    assert np.abs(inner).max() < 0.6
    assert abs(np.median(inner)) < 0.15
    assert len(scene.stems_m) == 3
    nearest = np.linalg.norm(scene.stems_m[:, None] - stems[None], axis=2).min(axis=0)
    assert nearest.max() < 0.12


def cloud_of(folder, points):
    path = folder / "map.ply"
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\n"
    )
    path.write_text(head + "end_header\n" + "\n".join(" ".join(map(str, row)) for row in points.tolist()))
    return inspect(path)


def grid_of(points):
    return Grid.over(points[:, :2].min(axis=0), points[:, :2].max(axis=0), 0.5)


def test_batches_add_up_to_the_whole(tmp_path):
    points, _ = made_map()
    found = cloud_of(tmp_path, points)
    whole, parts = Surface(grid_of(points)), Surface(grid_of(points))
    for batch in batches(found, at_once=100_000):
        whole.add(batch)
    for batch in batches(found, at_once=777):
        parts.add(batch)
    for name in ("highest", "lowest", "count"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(parts, name))
