"""A recording that somebody else's recorder made."""

from __future__ import annotations

import pytest

from tests.edge.replay import foreign


@pytest.fixture
def recording(tmp_path):
    """Eight sweeps, each with a fix."""
    return foreign.walk_with_fixes(tmp_path / "walk.mcap")
