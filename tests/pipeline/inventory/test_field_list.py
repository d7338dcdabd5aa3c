from types import SimpleNamespace

import numpy as np
import pyproj
import pytest

from pipeline.inventory.constellation import Constellation, match
from pipeline.inventory.errors import InventoryError
from pipeline.inventory.field_list import FieldList, FieldTree, read_field_list
from pipeline.inventory.tagged import with_field_list
from pipeline.inventory.trees import ListedTree, RejectedTree, TreeList

TURN = np.radians(137.0)


def stand(seed, count=200, side_m=50.0):
    """Places and diameters of a wood."""
    random = np.random.default_rng(seed)
    return random.uniform(0, side_m, (count, 2)), 0.08 + 0.18 * random.weibull(1.5, count)


def survey(seed, places, dbh, radius_m=9.0, extra=2):
    """What a crew writes down round (25, 25) with a compass that is 137 degrees off, and the rows that it is of; a few
    trees are not on the map."""
    random = np.random.default_rng(seed)
    rows = np.flatnonzero(np.hypot(*(places - 25.0).T) < radius_m)
    turn = np.array([[np.cos(TURN), np.sin(TURN)], [-np.sin(TURN), np.cos(TURN)]])
    at = np.vstack([(places[rows] - 25.0) @ turn.T, random.uniform(-6, 6, (extra, 2))])
    thick = np.append(dbh[rows], random.uniform(0.1, 0.4, extra))
    noisy = at + random.normal(0, 0.2, at.shape), thick * random.normal(1, 0.03, len(thick))
    return Constellation(*noisy), np.append(rows, np.full(extra, -1))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_list_without_bearing_or_place_is_matched_though_trees_are_missing_on_both_sides(seed):
    places, dbh = stand(seed)
    listed, rows = survey(seed, places, dbh)
    seen = np.flatnonzero(np.random.default_rng(seed).random(len(dbh)) > 0.15)
    found = match(listed, Constellation(places[seen], dbh[seen]))
    assert not found.why
    told = {int(row): int(seen[k]) for row, k in found.pairs}
    there = {row: int(rows[row]) for row in range(len(rows)) if rows[row] in seen}
    right = sum(told.get(row) == k for row, k in there.items())
    assert right >= 0.9 * len(there)
    assert len(told) - right <= 1
    assert abs(np.angle(np.exp(1j * (found.turn_rad - TURN)))) < 0.03
    np.testing.assert_allclose(found.shift_m, (25, 25), atol=0.3)


def test_what_fits_in_more_than_one_place_is_refused():
    grid = np.array([[x, y] for x in np.arange(0, 30, 3.0) for y in np.arange(0, 30, 3.0)])
    plantation = Constellation(grid, np.full(len(grid), 0.25))
    near = np.hypot(*(grid - 15.0).T) < 8
    found = match(Constellation(grid[near] - 15.0, np.full(near.sum(), 0.25)), plantation)
    assert "more than one place" in found.why
    assert len(found.pairs) == 0


def test_a_list_of_another_wood_and_one_of_few_trees_are_refused():
    places, dbh = stand(4)
    other, _ = survey(5, *stand(5))
    assert match(other, Constellation(places, dbh)).why
    assert "too few" in match(Constellation(places[:3], dbh[:3]), Constellation(places, dbh)).why


def test_tags_that_were_read_decide_where_the_rest_does_not():
    grid = np.array([[x, y] for x in np.arange(0, 30, 3.0) for y in np.arange(0, 30, 3.0)])
    near = np.flatnonzero(np.hypot(*(grid - 15.0).T) < 8)
    known = [(3, near[3]), (20, near[20])]
    found = match(
        Constellation(grid[near] - 15.0, np.full(len(near), 0.25)), Constellation(grid, np.full(len(grid), 0.25)), known
    )
    assert not found.why
    np.testing.assert_array_equal(found.pairs[:, 1], near[found.pairs[:, 0]])
    assert len(found.pairs) == len(near)


def test_a_tag_on_the_wrong_stem_does_not_lead_astray():
    places, dbh = stand(8)
    listed, rows = survey(8, places, dbh)
    astray = int(np.argmax(np.hypot(*(places - 25.0).T)))
    found = match(listed, Constellation(places, dbh), [(0, astray)])
    assert not found.why
    assert (0, astray) not in set(map(tuple, found.pairs.tolist()))
    assert all(rows[row] == k for row, k in found.pairs)


def test_coordinates_of_the_map_tell_where_few_trees_do_not():
    places, dbh = stand(6, 60)
    some = np.argsort(np.hypot(*(places - 25.0).T))[:6]
    listed = Constellation(places[some] + (0.8, -0.5), dbh[some])
    found = match(listed, Constellation(places, dbh), same_frame=True)
    np.testing.assert_array_equal(np.sort(found.pairs[:, 1]), np.sort(some))


def test_distance_and_azimuth_degrees_and_metres_are_read(tmp_path):
    path = tmp_path / "field.csv"
    path.write_text("# plot 17\nTag,Azimuth,Distance,DBH_cm,species\n12,90,5,31.5,Quercus rubra\n13,180,2,8,\n")
    found = read_field_list(path)
    assert found.frame == "plot"
    np.testing.assert_allclose(found.places_m(None), [[5, 0], [0, -2]], atol=1e-12)
    assert (found.trees[0].tag, found.trees[0].species, found.trees[0].dbh_m) == ("12", "Quercus rubra", 0.315)
    east, north = 440_000.0, 4_400_000.0
    lon, lat = pyproj.Transformer.from_crs(32618, 4326, always_xy=True).transform(east, north)
    path.write_text(f"tag,lat,lon,dbh_cm\n1,{lat!r},{lon!r},20\n")
    for crs in (pyproj.CRS(32618), None):
        np.testing.assert_allclose(read_field_list(path).places_m(crs), [[east, north]], atol=1e-3)
    with pytest.raises(InventoryError, match="no place"):
        read_field_list(path).on_map(None)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("x,y\n1,2\n", "expected dbh_cm"),
        ("tag,dbh_cm\n1,2\n", "azimuth_deg and distance_m"),
        ("x,y,dbh_cm\n1,2,0.3\n", ":2: a diameter of 0.3 cm; they are in centimetres"),
        ("x,y,dbh_cm\n\n1,north,30\n", ":3: x, y and dbh_cm are numbers"),
        ("x,y,dbh_cm\n", "no trees"),
        ("lon,lat,dbh_cm\n5,91,30\n", "in degrees"),
        ("tag,x,y,dbh_cm\n7,1,1,30\n7,2,2,30\n", "tag 7 is given to more than one tree"),
    ],
)
def test_a_wrong_field_list_is_told(tmp_path, text, told):
    path = tmp_path / "field.csv"
    path.write_text(text)
    with pytest.raises(InventoryError, match=told):
        read_field_list(path)


def test_tags_diameters_and_species_of_a_list_come_to_the_trees_and_the_rest_has_its_reason():
    places, dbh = stand(7)
    listed, rows = survey(7, places, dbh, extra=1)
    source = SimpleNamespace(origin_m=np.array([450_000.0, 5_200_000.0, 0]), bounds_m=np.array([[0, 0], [50, 50.0]]))
    source.crs = None
    at = np.column_stack([places + source.origin_m[:2], np.zeros(len(dbh))])
    trees = [
        ListedTree(k + 1, at[k], dbh[k], 0.01, 20.0, 4.0, species="pine", probability=0.6) for k in range(len(dbh))
    ]
    gone = int(rows[0])
    rejected = [RejectedTree((*at[gone, :2], 0.0), 0.2, "only 3 slices with bark")]
    field = FieldList(
        [FieldTree(*listed.places_m[k], listed.dbh_m[k], f"{k:03}", "oak") for k in range(len(listed.dbh_m))], "plot"
    )
    told = with_field_list(TreeList([t for t in trees if t.tree_id != gone + 1], rejected), field, source)
    tags = {tree.tree_id - 1: tree for tree in told.trees if tree.tag}
    assert told.match.matched == len(tags) == len(rows) - 2
    for k, row in enumerate(rows[1:-1].tolist(), start=1):
        assert tags[row].tag == f"{k:03}"
        assert tags[row].field_dbh_m == listed.dbh_m[k]
        assert (tags[row].species, np.isnan(tags[row].probability)) == ("oak", True)
    assert [one.tree.tag for one in told.unmatched] == ["000", f"{len(rows) - 1:03}"]
    assert told.unmatched[0].why == "rejected there: only 3 slices with bark"
    np.testing.assert_allclose(told.unmatched[0].position_m, at[gone, :2], atol=0.6)
    assert told.unmatched[1].why == "no stem was found there"
