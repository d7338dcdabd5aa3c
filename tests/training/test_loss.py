import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the detector is trained in an environment of its own")

from training.demo_detector import loss as losses  # noqa: E402
from training.demo_detector.network import boxes, cells  # noqa: E402

A = torch.tensor([[0.0, 0.0, 40.0, 80.0], [50.0, 10.0, 60.0, 90.0]])


def raw_for(corners, places, score):
    """Raw output whose every box is the given one."""
    centre, size = (corners[:2] + corners[2:]) / 2, corners[2:] - corners[:2]
    offset = (centre[:, None] - places[:2]) / places[2]
    log_size = (size[:, None] / places[2]).log()
    return torch.cat([offset, log_size, torch.full((1, places.shape[1]), score)])[None]


def test_cells_are_as_many_as_in_a_yolo_of_that_size():
    assert cells(640, 640).shape == (3, 8400)
    assert cells(832, 832).shape == (3, 14196)


def test_a_box_comes_back_from_the_raw_numbers():
    places = cells(96, 96)
    found = losses.to_corners(boxes(raw_for(A[0], places, 0.0), places))
    assert np.allclose(found[0].numpy(), A[0].numpy(), atol=1e-3)


def test_iou_is_that_of_painted_boxes():
    other = torch.tensor([[20.0, 30.0, 55.0, 85.0]])
    for row, box in enumerate(A.int().tolist()):
        ours, theirs = (np.zeros((100, 100), bool) for _ in range(2))
        ours[box[1] : box[3], box[0] : box[2]] = True
        theirs[30:85, 20:55] = True
        assert losses.iou(A, other)[row, 0].item() == pytest.approx((ours & theirs).sum() / (ours | theirs).sum())
        complete = losses.complete_iou(A[row : row + 1], other).item()
        assert complete < losses.iou(A, other)[row, 0].item()
    assert losses.complete_iou(A, A).tolist() == pytest.approx([1.0, 1.0])


def test_each_tree_is_answered_for_by_places_in_it_even_a_thin_stem():
    places = cells(96, 96)
    stem = torch.tensor([[33.0, 5.0, 35.0, 90.0]])  # between two columns of places
    trees = torch.cat([A, stem])
    corners = trees[torch.arange(places.shape[1]) % 3] + 0.2  # each place shows one of the three, a little off
    scores = torch.full((places.shape[1],), 0.01)
    place, tree, share = losses.assign(scores, corners, places, trees)
    assert set(tree.tolist()) == {0, 1, 2}
    assert len(set(place.tolist())) == len(place)
    assert losses.inside(places, trees)[place, tree].all()
    assert ((share > 0.0) & (share <= 1.0)).all()


def test_what_is_left_open_costs_nothing():
    places = cells(96, 96)
    raw = raw_for(A[0], places, 4.0)
    found = boxes(raw, places)
    none, shown = torch.empty(0, 4), A[:1]
    assert losses.loss(raw, found, places, [none], [none]).item() > 100.0
    assert losses.loss(raw, found, places, [none], [shown]).item() == pytest.approx(0.0, abs=1e-6)
