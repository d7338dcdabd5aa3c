"""Pictures of the screen for the documentation: `python -m ui.screenshots OUTDIR [--png]`.

Each state becomes `tui-<state>.svg`; with `--png` also a PNG, through cairosvg.
"""

from __future__ import annotations

import argparse
import asyncio
import importlib
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from edge.control.messages import Request, Status
from ui import samples
from ui.app import Options, RecorderApp
from ui.connection import Post
from ui.messages import Connected, ConnectionLost, StatusArrived

FONT = "DejaVu Sans Mono"
FONT_PX = 20.265
"""Rich lays out cells of 12.2 px; at this size the advance of DejaVu Sans Mono (1233/2048 em) is exactly that."""
PNG_SCALE = 15 / 12.2
"""Cells of whole pixels, or the renderer's rounding of advances would shift the columns."""
SIZE = (80, 24)
HISTORY_S = 40
"""Enough for the sparklines of a wide screen to be full."""


@dataclass
class Scene:
    """What the recorder said, a second apart, until the picture is taken. gone_s: since when it is out of reach."""

    statuses: tuple[Status, ...]
    gone_s: float | None = None
    keys: tuple[str, ...] = ()
    options: Options = field(default_factory=Options)


@dataclass
class SceneConnection:
    """Plays the statuses of a scene on a clock that only it moves. `sent` holds what the app asked."""

    scene: Scene
    now_s: float = 1000.0
    sent: list[Request] = field(default_factory=list)
    played: asyncio.Event = field(default_factory=asyncio.Event)

    async def run(self, post: Post) -> None:
        post(Connected())
        for status in self.scene.statuses:
            post(StatusArrived(status))
            # Let the app take this one before the next replaces it.
            await asyncio.sleep(0.002)
            self.now_s += 1.0
        self.now_s -= 0.8
        if self.scene.gone_s is not None:
            self.now_s += self.scene.gone_s
            post(ConnectionLost("The recorder closed the connection."))
        self.played.set()

    def send(self, request: Request) -> bool:
        self.sent.append(request)
        return self.scene.gone_s is None

    def clock(self) -> float:
        return self.now_s


def fading(status: Status) -> tuple[Status, ...]:
    """A good past that ends in `status`, so that the sparklines tell the story."""
    good = samples.recording() if status.state == "recording" else samples.idle()
    return (good,) * (HISTORY_S - 9) + (status,) * 9


SCENES: dict[str, Scene] = {
    "recording": Scene(fading(samples.GOOD)),
    "trouble": Scene(fading(samples.TROUBLE)),
    "ready": Scene(fading(samples.READY)),
    "stop": Scene(fading(samples.GOOD), keys=("space",)),
    "passed": Scene(fading(samples.PASSED)),
    "verdict": Scene(fading(samples.WARNED)),
    "gone": Scene(fading(samples.GOOD), gone_s=14.0),
    "sun": Scene(fading(samples.TROUBLE), options=Options(sun=True)),
    "help": Scene(fading(samples.READY), keys=("h",)),
}


async def shoot(scene: Scene, size: tuple[int, int] = SIZE) -> str:
    """The scene as SVG."""
    connection = SceneConnection(scene)
    app = RecorderApp(connection, scene.options, connection.clock)
    async with app.run_test(size=size) as pilot:
        await connection.played.wait()
        await pilot.press(*scene.keys)
        await pilot.pause()
        app.draw()
        await pilot.pause()
        return local_font(app.export_screenshot(title="mapforest tui"))


def local_font(svg: str) -> str:
    """Without fonts from the network: a picture must look the same offline, and renderers drop remote fonts anyway."""
    svg = re.sub(r"@font-face\s*\{.*?\}", "", svg, flags=re.DOTALL)
    svg = svg.replace("Fira Code", FONT).replace("font-family: arial", f"font-family: {FONT}")
    return svg.replace("font-size: 20px", f"font-size: {FONT_PX}px")


def main(arguments: Sequence[str] | None = None) -> int:
    """Write every scene to the folder named in `arguments`."""
    parser = argparse.ArgumentParser(prog="python -m ui.screenshots", description="Draw the screen in all its states.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--png", action="store_true", help="PNGs too; needs cairosvg and the font DejaVu Sans Mono")
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    for name, scene in SCENES.items():
        target = options.folder / f"tui-{name}.svg"
        target.write_text(asyncio.run(shoot(scene)), encoding="utf-8")
        if options.png:
            _to_png(target)
    return 0


def _to_png(svg: Path) -> None:
    # A tool of development, not a dependency of the program: imported here, and by name.
    cairosvg = importlib.import_module("cairosvg")
    cairosvg.svg2png(url=str(svg), write_to=str(svg.with_suffix(".png")), scale=PNG_SCALE)


if __name__ == "__main__":
    sys.exit(main())
