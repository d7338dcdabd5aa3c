import numpy as np
import pytest

from pipeline.inventory.device import DeviceBias, corrected, fit_device_bias
from pipeline.inventory.errors import InventoryError
from pipeline.inventory.field_list import FieldTree, read_field_list
from pipeline.inventory.stem import Stem
from pipeline.inventory.trees import ListedTree, TreeList, edited, read_edits, with_detections
from pipeline.trees import Tree
from tests.pipeline.inventory.plots import PlotMap


def stem(dbh=0.3):
    return Stem(np.zeros(3), np.zeros(2), dbh, 0.005, dbh, -0.005, 0.01, 500, 180.0, 0.9, 0.002)


def tree(number, x, y, dbh=0.3, sigma=0.005):
    return ListedTree(number, np.array([x, y, 0.0]), dbh, sigma, 20.0, 4.0, stem(dbh))


def detection(number, x, y, probability):
    where = np.array([x, y, 0.0])
    return Tree(number, "tree-of-heaven", "map", where, 0.01 * np.eye(3), probability, 9, 5, 0, True, 9, 2, 0, 1, ())


def test_an_analysts_file_adds_deletes_and_confirms(tmp_path):
    path = tmp_path / "edits.csv"
    path.write_text(
        "# mine\naction,x,y,dbh_cm,height_m,species,tag,note\nconfirm,0.1,0,31.5,,oak,T7,\n"
        "delete,5,5,,,,,a post\nadd,9,9,12,,beech,,behind the hut\ndelete,50,50,,,,,\n"
    )
    after = edited(TreeList([tree(1, 0, 0), tree(2, 5, 5)], []), read_edits(path))
    assert [(one.tree_id, one.status, one.species) for one in after.trees] == [
        (1, "confirmed", "oak"),
        (3, "added", "beech"),
    ]
    assert after.trees[0].dbh_m == pytest.approx(0.315)
    assert after.trees[0].tag == "T7"
    assert after.rejected[0].reason == "deleted by the analyst: a post"
    assert "line 6" in after.notes[0]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("action,x,y\nmove,1,2\n", r":2: action 'move'"),
        ("action,x,y,dbh_cm\nadd,1,2,\n", r":2: an added tree needs"),
        ("action,x,y\ndelete,one,2\n", r":2: x, y"),
        ("x,y\n1,2\n", r":1: expected the columns"),
    ],
)
def test_a_wrong_line_is_named(tmp_path, text, told):
    path = tmp_path / "edits.csv"
    path.write_text(text)
    with pytest.raises(InventoryError, match=told):
        read_edits(path)


def test_the_most_probable_detection_beside_a_stem_is_its_evidence():
    source = PlotMap([], each=1)
    trees = [tree(1, 450_005, 5_200_005), tree(2, 450_009, 5_200_005)]
    found = [detection(1, 5.3, 5.0, 0.9), detection(2, 5.1, 5.0, 0.2), detection(3, 30, 30, 0.9)]
    joined = with_detections(trees, found, source)
    assert (joined[0].species, joined[0].probability, joined[0].views) == ("tree-of-heaven", 0.9, 9)
    assert joined[1].species == ""


def test_marked_trees_tell_the_bias_of_a_device(tmp_path):
    path = tmp_path / "field.csv"
    path.write_text("tag,x,y,dbh_cm\n" + "".join(f"T{k},{10 * k},0.2,{30 + k}\n" for k in range(8)))
    marked = read_field_list(path).on_map(None)
    measured = [tree(k + 1, 10 * k, 0, 0.30 + k / 100 + 0.012) for k in range(8)]
    measured[3] = tree(4, 30, 0, 0.60)  # a slip of the tape
    bias = fit_device_bias(measured, marked)
    assert bias.marked == 7
    assert bias.offset_m == pytest.approx(0.012, abs=0.001)
    assert corrected(measured, bias)[0].dbh_m == pytest.approx(0.30, abs=0.001)
    with pytest.raises(InventoryError, match="same coordinates"):
        fit_device_bias(measured, [FieldTree(900.0, 900.0, 0.3)])


def test_diameters_taped_by_hand_are_not_corrected():
    by_hand = ListedTree(1, np.zeros(3), 0.3, np.nan, 20.0, 4.0, stem(), status="confirmed")
    assert corrected([by_hand], DeviceBias(0.01, 0.001, 5, 0.002))[0].dbh_m == 0.3
