"""A dataset in training, validation and test, so that no image of one is a neighbour of an image of another.

Blocks of place or time go into a split as a whole (`draw.py`); what lies within the gap of another split is set aside,
from training first, from the test never.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import msgspec
import numpy as np

from pipeline.dataset.blocks import BlockSize, By, find_blocks
from pipeline.dataset.draw import APART, FREE, Lottery, code_of, numbered
from pipeline.dataset.errors import SplitRefused
from pipeline.dataset.neighbours import Gap, Pair, leaks, near
from pipeline.dataset.record import GAP, SPLITS, ImageRecord, Split

_UNLABELLED = 0.01
"""Weight of an image nobody has looked at: it is placed, but does not count."""


@dataclass(frozen=True, slots=True)
class Rules:
    """shares: of training, validation and test. test_sites: all of them into the test. train_only: sources.

    keep: images that are in a split stay there. force: nothing is set aside, neighbours may straddle.
    """

    shares: tuple[float, float, float] = (0.8, 0.1, 0.1)
    by: By = "block"
    size: BlockSize = field(default_factory=BlockSize)
    gap: Gap = field(default_factory=Gap)
    seed: int = 0
    test_sites: Collection[str] = ()
    train_only: Collection[str] = ()
    keep: bool = False
    force: bool = False


@dataclass(frozen=True, slots=True)
class Division:
    """records: with their splits, in order. leaks: neighbours that straddle, none unless forced or kept so.

    loose: images with neither place nor time, of which nobody can say what they are near to.
    """

    records: list[ImageRecord]
    blocks: int
    set_aside: int
    leaks: list[Pair]
    loose: int


def divide(records: Sequence[ImageRecord], boxes: Sequence[int | None], rules: Rules) -> Division:
    """boxes: of each image, None where nobody has looked. The same for the same input and seed. SplitRefused."""
    _check_sites(records, rules)
    blocks = find_blocks(records, rules.by, rules.size)
    bound = [_bound([records[place] for place in block], rules) for block in blocks]
    _check_enough(bound, rules)
    codes = _lottery(records, boxes, blocks, bound, rules).best(rules.seed)
    splits: list[Split] = [GAP if code == APART else SPLITS[code] for code in codes.tolist()]
    divided = [msgspec.structs.replace(record, split=split) for record, split in zip(records, splits, strict=True)]
    return Division(
        records=divided,
        blocks=len(blocks),
        set_aside=splits.count(GAP),
        leaks=leaks(divided, rules.gap),
        loose=sum(1 for one in records if not (one.placed or one.group or (one.session and one.stamp_ns is not None))),
    )


def _bound(block: Sequence[ImageRecord], rules: Rules) -> Split:
    """Where a block has to go; "" where it is free."""
    if any(record.site in rules.test_sites for record in block):
        return "test"
    kept = {record.split for record in block if rules.keep and record.split in SPLITS}
    if kept:
        return max(kept, key=SPLITS.index)
    return "train" if any(record.source in rules.train_only for record in block) else ""


def _lottery(
    records: Sequence[ImageRecord],
    boxes: Sequence[int | None],
    blocks: Sequence[Sequence[int]],
    bound: Sequence[Split],
    rules: Rules,
) -> Lottery:
    block = np.zeros(len(records), np.int64)
    for number, members in enumerate(blocks):
        block[members] = number
    kept = [code_of(record.split) if rules.keep else FREE for record in records]
    pairs = [] if rules.force else [(pair.i, pair.j) for pair in near(records, rules.gap)]
    return Lottery(
        block=block,
        source=numbered([record.source for record in records]),
        weight=np.array([_UNLABELLED if count is None else 1.0 + count for count in boxes]),
        kept=np.array(kept, np.int64),
        bound=np.array([code_of(split) for split in bound], np.int64),
        pairs=np.array(pairs, np.int64).reshape(-1, 2),
        shares=np.array(rules.shares),
    )


def _check_sites(records: Sequence[ImageRecord], rules: Rules) -> None:
    sites = {record.site for record in records if record.site}
    for name in rules.test_sites:
        if name not in sites:
            raise SplitRefused(f"no image is of site {name!r}; there are {', '.join(sorted(sites)) or 'none'}")


def _check_enough(bound: Sequence[Split], rules: Rules) -> None:
    needed = {split for split, share in zip(SPLITS, rules.shares, strict=True) if share > 0} - set(bound)
    free = sum(1 for split in bound if not split)
    if free < len(needed):
        what = {"site": "sites", "block": "blocks", "image": "images"}[rules.by]
        raise SplitRefused(
            f"{free} {what} cannot be shared among {len(needed)} splits; make the blocks smaller (--block), walk more, "
            "or divide single images (--by image --force) and see what leaks"
        )
