"""Each state as it looks, at 80x24 and larger: compare `tests/ui/__snapshots__` by eye after a change."""

import pytest

from ui.app import RecorderApp
from ui.screenshots import SCENES, SceneConnection

SMALL, LARGE = (80, 24), (120, 36)


@pytest.mark.parametrize(("name", "size"), [*((name, SMALL) for name in SCENES), ("trouble", LARGE)])
def test_state_looks_as_agreed(snap_compare, name, size):
    connection = SceneConnection(SCENES[name])
    app = RecorderApp(connection, connection.scene.options, connection.clock)

    async def play(pilot):
        await connection.played.wait()
        await pilot.press(*connection.scene.keys)
        await pilot.pause()
        app.draw()
        await pilot.pause()

    assert snap_compare(app, terminal_size=size, run_before=play)
