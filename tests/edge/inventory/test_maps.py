"""Which map is meant, and with which voxels."""

import msgspec
import numpy as np
import pytest

from edge.config import Config
from edge.errors import EdgeError
from edge.inventory.fine import FINE_M, fine_map
from edge.inventory.maps import find_map
from edge.process.fusion_stage import PLACEMENT, write_placement
from edge.process.process import Task, process
from edge.process.watch import Watch
from pipeline.products.track import Placement
from tests.edge.process.test_process import StraightOn, fakes
from tests.edge.replay import foreign


@pytest.fixture
def recording(tmp_path):
    return foreign.walk_with_fixes(tmp_path / "walk.mcap")


def remap(load):
    return lambda session: fine_map(session.recording, session.places, Config(), Watch(), load)


class Elsewhere(StraightOn):
    def process(self, sweep):
        for one in super().process(sweep) or ():
            one.estimate.position_m[1] += 1.0
            yield one


def test_a_map_has_the_voxels_that_it_was_made_with_whatever_is_configured_now(recording):
    products = process(Task([recording]), Config(), load=fakes()).folder
    now = msgspec.structs.replace(Config(), products=msgspec.structs.replace(Config().products, voxel_m=0.5))
    found = find_map(products, now)
    assert found.source.voxel_m == Config().products.voxel_m
    assert any(f"mapforest inventory {products} --fine" in note for note in found.notes)


def test_it_is_mapped_once_more_with_small_voxels_on_the_same_placement_and_only_once(recording):
    products = process(Task([recording]), Config(), load=fakes()).folder
    coarse, fine = find_map(products, Config()), find_map(products, Config(), remap(fakes()))
    assert fine.source.voxel_m == FINE_M
    assert not fine.notes
    assert fine.source.count > coarse.source.count
    np.testing.assert_allclose(fine.source.bounds_m, coarse.source.bounds_m, atol=0.1)
    assert find_map(products, Config(), remap(None)).source.count == fine.source.count


def test_an_odometry_that_goes_another_way_the_second_time_is_refused(recording):
    products = process(Task([recording]), Config(), load=fakes()).folder
    with pytest.raises(EdgeError, match="another way than the first time"):
        find_map(products, Config(), remap(fakes(odometry=Elsewhere)))
    recording.unlink()
    with pytest.raises(EdgeError, match="not beside its products"):
        find_map(products, Config(), remap(fakes()))


def test_the_products_of_a_refinement_are_the_same_map_on_its_trajectory(recording):
    products = process(Task([recording]), Config(), load=fakes()).folder
    first = find_map(products, Config())
    (products / "refined" / "work" / "refinement").mkdir(parents=True)
    count, up = 7, np.array([0.0, 0.0, 30.0])
    moved = Placement(
        (47.0, 8.0, 500.0), np.tile(up, (count, 1)), np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 6, 6))
    )
    write_placement(products / "refined" / "work" / "refinement" / PLACEMENT, moved)
    refined = find_map(products / "refined", Config())
    assert (refined.folder, refined.source.name) == (products / "refined" / "inventory", "walk, refined")
    assert refined.source.count == first.source.count
    assert min(part.xyz_m[:, 2].min() for part in refined.source.parts()) > 20.0


def test_a_file_is_not_mapped_once_more(tmp_path):
    with pytest.raises(EdgeError, match="run `mapforest process` first"):
        find_map(tmp_path / "map.laz", Config(), remap(None))
