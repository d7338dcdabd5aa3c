"""What is wrong with a session beyond its recording, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from drivers.messages import FixQuality
from edge.report.made import Made
from edge.validation.report import Finding, Level
from pipeline.products.occurrences import UNVERIFIED

LOST_SHARE = 0.1
"""Of the sweeps, without a pose."""
DEGENERATE_SHARE = 0.1
POOR_M = 2.0
"""One sigma, horizontal: the crew looks for a tree within twice that."""
RTK_SHARE = 0.2
OLD_S = 10.0
FEW_HITS = 2


def advise(made: Made | None) -> tuple[Finding, ...]:
    """Worst first."""
    if made is None:
        text = "The recording has not been processed: there is no trajectory, no map and no tree to show."
        return (Finding(Level.WARN, "", text, "Run `mapforest process` on it, then this report again."),)
    found = [*_odometry(made), *_position(made), *_trees(made)]
    return tuple(sorted(found, key=lambda one: one.level, reverse=True))


def _odometry(made: Made) -> Iterator[Finding]:
    facts = made.facts
    lost = 1.0 - facts.estimates / max(facts.sweeps, 1)
    if lost > LOST_SHARE:
        yield Finding(
            Level.WARN,
            "",
            f"{lost:.0%} of the sweeps gave no pose; the map has holes there.",
            "Stand still for ten seconds after the start. The notes below say why poses are missing; lost inertial "
            "samples are a matter of the network cable and of a computer that is too busy.",
        )
    share = facts.degenerate / max(facts.estimates, 1)
    if share > DEGENERATE_SHARE:
        yield Finding(
            Level.WARN,
            "",
            f"In {share:.0%} of the poses the LiDAR alone could not tell the position.",
            "Keep stems and ground in view, and turn slowly where there is only one wall or an open field.",
        )


def _position(made: Made) -> Iterator[Finding]:
    if made.placed is None:
        yield Finding(
            Level.WARN,
            "",
            "The session has no place on the Earth: all files are local.",
            "Wait for a fix in the open before walking in, and walk at least 20 m with it.",
        )
        return
    sigma = made.poses.horizontal_sigma_m
    if len(sigma) and sigma.max() > POOR_M:
        at_s = float(made.poses.seconds[int(np.argmax(sigma))])
        yield Finding(
            Level.WARN,
            "",
            f"The position is known to {sigma.max():.1f} m (one sigma) at worst, {at_s:.0f} s after the first pose.",
            "Give the crew that distance to search in. Walk loops, and step into gaps of the canopy now and then.",
        )
    yield from _corrections(made)


def _corrections(made: Made) -> Iterator[Finding]:
    placed = [fix for fix in made.fixes if fix.quality is not FixQuality.INVALID]
    if not placed:
        return
    good = sum(fix.quality in (FixQuality.RTK_FIXED, FixQuality.RTK_FLOAT) for fix in placed) / len(placed)
    if good < RTK_SHARE:
        yield Finding(
            Level.WARN,
            "",
            f"Only {good:.0%} of the fixes had RTK corrections.",
            "Look at the corrections on the receiver (NTRIP, radio) before the walk; without them expect metres.",
        )
    ages = np.array([fix.age_s for fix in placed if fix.age_s is not None])
    if len(ages) and np.mean(ages > OLD_S) > RTK_SHARE:
        yield Finding(
            Level.WARN,
            "",
            f"{np.mean(ages > OLD_S):.0%} of the corrections were older than {OLD_S:.0f} s.",
            "The link to the base was interrupted: a better antenna, another network, or a base nearby.",
        )


def _trees(made: Made) -> Iterator[Finding]:
    found = made.facts.findings
    if found is None:
        return
    if found.demonstration:
        yield Finding(
            Level.WARN,
            "",
            f"The detector {found.model} learned from simulated images.",
            "Never report what it finds. Train a model on real pictures for real forests.",
        )
    if made.unverified:
        yield Finding(Level.NOTE, "", f"{made.unverified} of {found.trees} trees are unverified.", UNVERIFIED)
    weak = [int(tree["tree_id"]) for tree in made.trees if tree["n_hits"] <= FEW_HITS]
    if weak:
        named = ", ".join(map(str, weak[:20])) + (" and others" if len(weak) > 20 else "")
        yield Finding(
            Level.NOTE,
            "",
            f"Recognised in {FEW_HITS} images or fewer: {named}.",
            "Look at the pictures of these trees first, before anybody walks there.",
        )
