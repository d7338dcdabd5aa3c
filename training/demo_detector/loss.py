"""What the network is trained on: which place answers for which tree, and how wrong it is.

Assignment is task-aligned (Feng et al., TOOD, ICCV 2021): the places that already score and fit a tree best answer for
it. Boxes by complete IoU (Zheng et al., AAAI 2020), scores by cross-entropy against the alignment.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional

BEST = 10
SCORE_POWER, OVERLAP_POWER = 0.5, 6.0
LEFT_OPEN_IOU = 0.5
BOX_WEIGHT = 5.0
REACH_STRIDES = 1.0
"""A tree is also answered for by places so near to the middle of its box: a thin stem lies between the places."""
EPSILON = 1e-7


def loss(raw: Tensor, found: Tensor, places: Tensor, wanted: list[Tensor], left_open: list[Tensor]) -> Tensor:
    """Of a batch: raw (b, 4 + 1, N), found (b, 4, N) its boxes as cx, cy, w, h; wanted, left_open: (n, 4) corners."""
    corners = to_corners(found)
    scores = raw[:, 4].sigmoid()
    overlap_loss, targets, weights = [], torch.zeros_like(scores), torch.ones_like(scores)
    for k, (trees, others) in enumerate(zip(wanted, left_open, strict=True)):
        if len(others):
            # Box by box: a place that shows what was left open is neither right nor wrong.
            weights[k] = (iou(corners[k].detach(), others).amax(dim=1) < LEFT_OPEN_IOU).float()
        if len(trees):
            place, tree, share = assign(scores[k].detach(), corners[k].detach(), places, trees)
            targets[k, place] = share
            weights[k, place] = 1.0
            overlap_loss.append(share * (1.0 - complete_iou(corners[k, place], trees[tree])))
    total = targets.sum().clamp(min=1.0)
    score_loss = functional.binary_cross_entropy_with_logits(raw[:, 4], targets, weights, reduction="sum") / total
    box_loss = torch.cat(overlap_loss).sum() / total if overlap_loss else raw.sum() * 0.0
    return score_loss + BOX_WEIGHT * box_loss


@torch.no_grad()
def assign(scores: Tensor, corners: Tensor, places: Tensor, trees: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Places that answer for a tree, for which one, and the score 0..1 each should have."""
    overlap = iou(corners, trees)
    alignment = scores[:, None] ** SCORE_POWER * overlap**OVERLAP_POWER * inside(places, trees)
    best = alignment.topk(min(BEST, len(alignment)), dim=0)
    kept = torch.zeros_like(alignment).scatter_(0, best.indices, best.values)
    place = torch.nonzero(kept.amax(dim=1) > EPSILON**2).flatten()
    # One that serves two trees answers for the one it covers better.
    tree = (overlap[place] * (kept[place] > 0.0)).argmax(dim=1)
    own = kept[place, tree]
    highest = torch.zeros(len(trees)).scatter_reduce_(0, tree, own, "amax")[tree]
    reached = torch.zeros(len(trees)).scatter_reduce_(0, tree, overlap[place, tree], "amax")[tree]
    return place, tree, own / (highest + EPSILON**2) * reached


def inside(places: Tensor, trees: Tensor) -> Tensor:
    """(N, n) whether a place lies in a tree's box, or next to its middle."""
    x, y, stride = places[:, :, None]
    within = (x > trees[:, 0]) & (x < trees[:, 2]) & (y > trees[:, 1]) & (y < trees[:, 3])
    off_x, off_y = (x - (trees[:, 0] + trees[:, 2]) / 2).abs(), (y - (trees[:, 1] + trees[:, 3]) / 2).abs()
    return within | (torch.maximum(off_x, off_y) < REACH_STRIDES * stride)


def to_corners(boxes: Tensor) -> Tensor:
    """(b, N, 4) x_min, y_min, x_max, y_max from (b, 4, N) cx, cy, w, h."""
    centre, half = boxes[:, :2], boxes[:, 2:] / 2
    return torch.cat([centre - half, centre + half], dim=1).transpose(1, 2)


def iou(a: Tensor, b: Tensor) -> Tensor:
    """(n, m) of all pairs of corners (n, 4), (m, 4)."""
    common = (torch.minimum(a[:, None, 2:], b[:, 2:]) - torch.maximum(a[:, None, :2], b[:, :2])).clamp(min=0.0)
    common_area = common.prod(dim=2)
    return common_area / (area(a)[:, None] + area(b) - common_area + EPSILON)


def area(corners: Tensor) -> Tensor:
    """(n,)."""
    return (corners[:, 2:] - corners[:, :2]).prod(dim=1)


def complete_iou(a: Tensor, b: Tensor) -> Tensor:
    """(n,) of rows (n, 4): IoU less the distance of the middles and the difference in shape."""
    common = (torch.minimum(a[:, 2:], b[:, 2:]) - torch.maximum(a[:, :2], b[:, :2])).clamp(min=0.0).prod(dim=1)
    overlap = common / (area(a) + area(b) - common + EPSILON)
    hull = torch.maximum(a[:, 2:], b[:, 2:]) - torch.minimum(a[:, :2], b[:, :2])
    apart = (a[:, :2] + a[:, 2:] - b[:, :2] - b[:, 2:]).square().sum(dim=1) / 4.0
    slant = torch.atan2(*(a[:, 2:] - a[:, :2]).unbind(1)) - torch.atan2(*(b[:, 2:] - b[:, :2]).unbind(1))
    shape = 4.0 / math.pi**2 * slant.square()
    with torch.no_grad():
        shape_weight = shape / (1.0 - overlap + shape + EPSILON)
    return overlap - apart / (hull.square().sum(dim=1) + EPSILON) - shape_weight * shape
