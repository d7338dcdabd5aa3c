"""A dataset in training, validation and test, so that no image of one is a neighbour of an image of another.

Blocks of place or time go into a split as a whole, the best of some seeded draws; what lies within the gap of another
split is set aside, from training first, from the test never.
"""

from __future__ import annotations

import random
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import msgspec

from pipeline.dataset.blocks import BlockSize, By, find_blocks
from pipeline.dataset.errors import SplitRefused
from pipeline.dataset.neighbours import Gap, Pair, leaks, near
from pipeline.dataset.record import GAP, SPLITS, ImageRecord, Split

DRAWS = 64
_UNLABELLED = 0.01
"""Weight of an image nobody has looked at: it is placed, but does not count."""
_EMPTY = 100.0
_LEAST_ODDS = 0.01


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
    splits: list[Split] = [""] * len(records)
    for block, split in zip(blocks, _best(records, boxes, blocks, bound, rules), strict=True):
        for place in block:
            own = records[place].split
            splits[place] = own if rules.keep and own in SPLITS else split
    if not rules.force:
        _set_aside(records, splits, rules.gap)
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


def _best(
    records: Sequence[ImageRecord],
    boxes: Sequence[int | None],
    blocks: Sequence[Sequence[int]],
    bound: list[Split],
    rules: Rules,
) -> list[Split]:
    weights = [sum(_UNLABELLED if boxes[place] is None else 1.0 + (boxes[place] or 0) for place in b) for b in blocks]
    draw = _Draw(weights, [records[block[0]].source for block in blocks], bound, _wanted(rules))
    dice = random.Random(rules.seed)
    return min((draw.draw(dice) for _ in range(DRAWS)), key=draw.unfair)


@dataclass(frozen=True, slots=True)
class _Draw:
    """What is drawn from: weight, source and, where it is not free, split of each block."""

    weights: list[float]
    sources: list[str]
    bound: list[Split]
    shares: dict[Split, float]

    def totals(self) -> dict[str, float]:
        """Weight of each source."""
        found = dict.fromkeys(self.sources, 0.0)
        for source, weight in zip(self.sources, self.weights, strict=True):
            found[source] += weight
        return found

    def draw(self, dice: random.Random) -> list[Split]:
        """Blocks in any order, each with good odds where much of its source is lacking."""
        totals, splits = self.totals(), list(self.bound)
        lacking = {(source, split): share * totals[source] for source in totals for split, share in self.shares.items()}
        for source, split, weight in zip(self.sources, splits, self.weights, strict=True):
            if split in self.shares:
                lacking[source, split] -= weight
        free = [place for place, split in enumerate(splits) if not split]
        dice.shuffle(free)
        wanted = list(self.shares)
        for place in free:
            source = self.sources[place]
            odds = [max(lacking[source, split], _LEAST_ODDS * totals[source]) for split in wanted]
            splits[place] = dice.choices(wanted, odds)[0]
            lacking[source, splits[place]] -= self.weights[place]
        return splits

    def unfair(self, splits: Sequence[Split]) -> float:
        """How far from the shares asked for, in each source; a split without anything is worst."""
        totals = self.totals()
        have = {(source, split): 0.0 for source in totals for split in SPLITS}
        for source, split, weight in zip(self.sources, splits, self.weights, strict=True):
            have[source, split] += weight
        off = sum(
            totals[source] * (have[source, split] / totals[source] - share) ** 2 / share
            for source in totals
            for split, share in self.shares.items()
        )
        missing = sum(1 for split in self.shares if split not in splits)
        return off / sum(totals.values()) + _EMPTY * missing


def _set_aside(records: Sequence[ImageRecord], splits: list[Split], gap: Gap) -> None:
    """Of two neighbours in different splits the one of training goes first, then the one of validation."""
    crossing = [pair for pair in near(records, gap) if splits[pair.i] != splits[pair.j]]
    for winner in ("test", "val"):
        for pair in crossing:
            for one, other in ((pair.i, pair.j), (pair.j, pair.i)):
                if splits[one] == winner and splits[other] in SPLITS and splits[other] != winner:
                    splits[other] = GAP


def _check_sites(records: Sequence[ImageRecord], rules: Rules) -> None:
    sites = {record.site for record in records if record.site}
    for name in rules.test_sites:
        if name not in sites:
            raise SplitRefused(f"no image is of site {name!r}; there are {', '.join(sorted(sites)) or 'none'}")


def _check_enough(bound: Sequence[Split], rules: Rules) -> None:
    needed = set(_wanted(rules)) - set(bound)
    free = sum(1 for split in bound if not split)
    if free < len(needed):
        what = {"site": "sites", "block": "blocks", "image": "images"}[rules.by]
        raise SplitRefused(
            f"{free} {what} cannot be shared among {len(needed)} splits; make the blocks smaller (--block), walk more, "
            "or divide single images (--by image --force) and see what leaks"
        )


def _wanted(rules: Rules) -> dict[Split, float]:
    """The splits that are to get something, and how much."""
    return {split: share for split, share in zip(SPLITS, rules.shares, strict=True) if share > 0}
