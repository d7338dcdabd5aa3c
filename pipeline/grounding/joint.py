"""All views together: a box that one tree explains speaks for no other.

View by view a box goes to what it fits best there, and a stem that stands in line with a tree for a while is as good
as the tree. Over all views only one of them fits throughout. So each box is shared among all that it may mean, by fit
and by how probable each is by all views, and that probability is found anew from the shares (expectation
maximisation).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
ROUNDS = 10
ELSEWHERE = 0.01
"""Density (1/m2) of boxes that mean nothing that is known."""


@dataclass(frozen=True, slots=True, eq=False)
class Claims:
    """Of one view with boxes (b,): which (h,) hypotheses they may mean, and how much of a new look this is (h,).

    fit: (h, b) density of each box as theirs (1/m2). gain: (h, b) how many times more probable a target makes it.
    missed: (h,) log-odds of none being theirs; 0 where hidden.
    """

    which: npt.NDArray[np.int64]
    fresh: Array
    fit: Array
    gain: Array
    missed: Array

    def change(self, log_odds: Array, power: float) -> Array:
        """(h,) log-odds that the view adds, by the log-odds (n,) of all; one box at most is a tree's.

        power: of the probability in the shares.
        """
        weight = self.fit / (1.0 + np.exp(-log_odds[self.which]))[:, None] ** power
        share = weight / (weight.sum(axis=0) + ELSEWHERE)
        share = share / np.maximum(share.sum(axis=1, keepdims=True), 1.0)
        mine = share.sum(axis=1)
        gain = (share * self.gain).sum(axis=1) / np.maximum(mine, 1e-9)
        return np.asarray(self.fresh * (np.log1p(mine * np.maximum(gain - 1.0, 0.0)) + (1.0 - mine) * self.missed))


def settled(prior: Array, claims: Sequence[Claims], most: float) -> Array:
    """(n,) log-odds of hypotheses, within +-most; prior: (n,) what stands without the boxes."""
    log_odds = prior
    for k in range(ROUNDS):
        power = min(1.0, 2.0 * k / ROUNDS)  # by fit alone at first: what comes first must not win by that
        change = np.zeros(len(prior))
        for one in claims:
            np.add.at(change, one.which, one.change(log_odds, power))
        log_odds = np.clip(prior + change, -most, most)
    return log_odds
