"""Which block goes to which split: the best of some seeded draws, judged by what is left after the gap."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.dataset.record import SPLITS, Split

FREE, APART = -1, len(SPLITS)
"""Codes of blocks that may go anywhere, and of images set aside; the others are places in SPLITS."""
DRAWS = 128
_LEAST_ODDS = 0.01
_EMPTY, _LOST = 100.0, 0.5
Codes = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Lottery:
    """block, source: (n,) numbers of each image. weight: (n,) what it counts. kept: (n,) its split, or FREE.

    bound: split of each block, or FREE. pairs: (m, 2) images that must not straddle. shares: of each split.
    """

    block: Codes
    source: Codes
    weight: npt.NDArray[np.float64]
    kept: Codes
    bound: Codes
    pairs: Codes
    shares: npt.NDArray[np.float64]

    def best(self, seed: int) -> Codes:
        """(n,) codes of the images."""
        dice = random.Random(seed)
        draws = [self._images(self._draw(dice)) for _ in range(DRAWS)]
        return min(draws, key=self._unfair)

    def _draw(self, dice: random.Random) -> Codes:
        """Blocks in any order, each with good odds where much of its source is lacking."""
        blocks = len(self.bound)
        weight = np.bincount(self.block, self.weight, blocks).tolist()
        source = np.zeros(blocks, np.int64)
        source[self.block] = self.source
        totals = np.bincount(self.source, self.weight).tolist()
        lacking = [[share * total for share in self.shares.tolist()] for total in totals]
        wanted = np.flatnonzero(self.shares).tolist()
        splits = self.bound.tolist()
        for place in np.flatnonzero(self.bound != FREE).tolist():
            lacking[source[place]][splits[place]] -= weight[place]
        free = np.flatnonzero(self.bound == FREE).tolist()
        dice.shuffle(free)
        for place in free:
            row, least = lacking[source[place]], _LEAST_ODDS * totals[source[place]]
            chosen = dice.choices(wanted, [max(row[split], least) for split in wanted])[0]
            splits[place] = chosen
            row[chosen] -= weight[place]
        return np.array(splits, np.int64)

    def _images(self, splits: Codes) -> Codes:
        """Of two images that must not straddle the one of training is set aside, else the one of validation."""
        codes = np.where(self.kept == FREE, splits[self.block], self.kept)
        both = np.vstack([self.pairs, self.pairs[:, ::-1]])
        for winner in (SPLITS.index("test"), SPLITS.index("val")):
            one, other = codes[both[:, 0]], codes[both[:, 1]]
            codes[both[(one == winner) & (other != winner) & (other != APART), 1]] = APART
        return codes

    def _unfair(self, codes: Codes) -> float:
        """How far from the shares, in each source; what is set aside is lost, a split without anything worst."""
        sources = int(self.source.max()) + 1
        cells = np.bincount(self.source * (APART + 1) + codes, self.weight, sources * (APART + 1))
        have, total = cells.reshape(sources, -1)[:, :APART], self.weight.sum()
        left = have.sum(axis=1)
        wanted = self.shares > 0
        there = have[:, wanted] / np.maximum(left, 1e-9)[:, None]
        off = ((there - self.shares[wanted]) ** 2 / self.shares[wanted]).sum(axis=1) @ left / total
        missing = int((have.sum(axis=0)[wanted] == 0).sum())
        return float(off + _LOST * (1.0 - left.sum() / total) + _EMPTY * missing)


def code_of(split: Split) -> int:
    """FREE for none."""
    return SPLITS.index(split) if split in SPLITS else FREE


def numbered(names: Sequence[str]) -> Codes:
    """(n,) a number for each name, in order of appearance."""
    numbers: dict[str, int] = {}
    return np.array([numbers.setdefault(name, len(numbers)) for name in names], np.int64)
