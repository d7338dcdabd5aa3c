import laspy
import numpy as np
import pyproj
import pytest

from pipeline.inventory.errors import InventoryError
from pipeline.inventory.source import open_map
from pipeline.inventory.tilemap import TileMap
from pipeline.products.tiles import TileStore
from pipeline.products.track import Placement

RANDOM = np.random.default_rng(1)
FAR = np.array([453_210.25, 5_234_567.5, 310.125])


def written_ply(path, points, form="binary_little_endian"):
    head = f"ply\nformat {form} 1.0\ncomment a\nelement vertex {len(points)}\nproperty double x\nproperty double y\n"
    head += "property uchar red\nproperty float z\nend_header\n"
    order = ">" if form == "binary_big_endian" else "<"
    rows = np.zeros(len(points), [("x", order + "f8"), ("y", order + "f8"), ("r", "u1"), ("z", order + "f4")])
    rows["x"], rows["y"], rows["z"] = points.T
    body = rows.tobytes() if form != "ascii" else "".join(f"{x} {y} 7 {z}\n" for x, y, z in points.tolist()).encode()
    path.write_bytes(head.encode() + body)
    return path


def written_las(path, points, crs=None, version="1.4"):
    header = laspy.LasHeader(version=version, point_format=6 if version == "1.4" else 0)
    header.scales, header.offsets = np.full(3, 0.001), np.floor(points.min(axis=0))
    if crs is not None:
        header.add_crs(pyproj.CRS(crs))
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    las.write(path)
    return path


def everything(source):
    return source.placed(np.concatenate([part.xyz_m for part in source.parts()]).astype(np.float64))


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_ply_keeps_its_millimetres_far_from_the_origin(tmp_path, form):
    points = FAR + RANDOM.uniform(0, 40, (500, 3))
    np.testing.assert_allclose(everything(open_map(written_ply(tmp_path / "a.ply", points, form))), points, atol=2e-5)


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_a_las_keeps_its_millimetres_and_its_reference_system(tmp_path, name):
    points = FAR + RANDOM.uniform(0, 40, (500, 3))
    source = open_map(written_las(tmp_path / name, points, 32618))
    np.testing.assert_allclose(everything(source), points, atol=6e-4)
    assert source.crs.to_epsg() == 32618


def test_feet_degrees_and_swapped_axes_are_told(tmp_path):
    points = FAR + RANDOM.uniform(0, 40, (50, 3))
    with pytest.raises(InventoryError, match="foot"):
        open_map(written_las(tmp_path / "feet.las", points, 2272))
    with pytest.raises(InventoryError, match="degree"):
        open_map(written_las(tmp_path / "deg.las", [-75.2, 40.05, 100] + RANDOM.uniform(0, 1, (50, 3)) / 1e3, 4326))
    with pytest.raises(InventoryError, match="degrees"):
        open_map(
            written_las(tmp_path / "bare.las", [-75.2, 40.05, 100] + RANDOM.uniform(0, 1, (50, 3)) * [0.1, 0.1, 9])
        )
    with pytest.raises(InventoryError, match="swapped"):
        open_map(written_las(tmp_path / "swap.las", RANDOM.uniform(0, 1, (50, 3)) * [30, 40, 90_000]))


def test_broken_files_are_told(tmp_path):
    whole = written_las(tmp_path / "a.laz", FAR + RANDOM.uniform(0, 40, (5000, 3)))
    (tmp_path / "cut.laz").write_bytes(whole.read_bytes()[:9000])
    with pytest.raises(InventoryError, match=r"cut\.laz"):
        everything(open_map(tmp_path / "cut.laz"))
    ply = written_ply(tmp_path / "b.ply", FAR + RANDOM.uniform(0, 40, (500, 3)))
    (tmp_path / "cut.ply").write_bytes(ply.read_bytes()[:-300])
    with pytest.raises(InventoryError, match="ends after 485 of 500 points"):
        open_map(tmp_path / "cut.ply")
    (tmp_path / "text.ply").write_text("hello")
    with pytest.raises(InventoryError, match="does not begin"):
        open_map(tmp_path / "text.ply")
    with pytest.raises(InventoryError, match="no such file"):
        open_map(tmp_path / "none.laz")
    with pytest.raises(InventoryError, match="expected a session"):
        open_map(tmp_path / "a.txt")
    laspy.LasData(laspy.LasHeader(version="1.4", point_format=6)).write(tmp_path / "empty.las")
    with pytest.raises(InventoryError, match="has no points"):
        open_map(tmp_path / "empty.las")


def test_a_sessions_map_knows_where_the_scanner_stood(tmp_path):
    store = TileStore(tmp_path / "tiles", 16.0, 0.02)
    positions = np.array([[0.0, 0.0, 1.0], [30.0, 0.0, 1.0]])
    for sweep, position in enumerate(positions):
        xyz = position + RANDOM.uniform(-5, 5, (300, 3))
        store.add(np.column_stack([xyz, np.full(300, 200.0 if sweep else 20.0)]).astype(np.float32), sweep)
    store.close()
    shift, quarter = np.tile([2.0, 0.0, 0.0], (2, 1)), np.full(2, np.pi / 2)
    placement = Placement.upright((40.0, -75.0, 50.0), shift, quarter, np.zeros((2, 6, 6)))
    source = TileMap(tmp_path / "tiles", 0.02, positions, placement)
    assert source.count == 600
    assert source.crs.to_epsg() == 32618
    for part in source.parts():
        assert (np.abs(part.xyz_m[:, :2] - part.sensor_m) < 5.01).all()
        np.testing.assert_array_equal(part.reflector, part.sensor_m[:, 1] > 20)
    np.testing.assert_allclose(source.placed(np.zeros((1, 3)))[0, :2], [500_000, 4_427_757], atol=1.0)
