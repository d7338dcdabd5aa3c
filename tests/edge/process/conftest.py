"""A recording that somebody else's recorder made."""

from __future__ import annotations

import pytest

from tests.edge.replay import foreign
from tests.edge.replay.foreign import START_NS, SWEEP_NS


@pytest.fixture
def recording(tmp_path):
    """Eight sweeps, each with a fix."""
    bag = foreign.walk(foreign.custom, sweeps=8)
    for k in range(8):
        bag.add("/fix", START_NS + k * SWEEP_NS, foreign.fix(START_NS + k * SWEEP_NS))
    return bag.write(tmp_path / "walk.mcap")
