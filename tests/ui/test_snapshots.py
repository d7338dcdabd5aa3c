"""Each state as it looks, at 80x24 and larger: compare `tests/ui/screens` by eye after a change."""

import re
from pathlib import Path

import pytest

from ui.screenshots import SCENES, SIZE, shoot

SCREENS = Path(__file__).parent / "screens"
LARGE = (120, 36)


@pytest.mark.parametrize(("name", "size"), [*((name, SIZE) for name in SCENES), ("trouble", LARGE)])
async def test_state_looks_as_agreed(name, size, tmp_path):
    agreed = SCREENS / f"{name}-{size[0]}x{size[1]}.svg"
    drawn = tmp_path / agreed.name
    # The renderer names its styles after a number that differs from one version of Python to the next.
    drawn.write_text(re.sub(r"terminal-\d+", "terminal", await shoot(SCENES[name], size)), encoding="utf-8")

    assert drawn.read_text() == agreed.read_text(), f"look at {drawn}; if it is meant, copy it to {agreed}"
