"""One picture of what the simulated camera sees: `python -m drivers.sim.still OUT.jpg [SCENARIO [SECONDS]]`."""

from __future__ import annotations

import sys

import cv2

from drivers.sim.camera import Camera
from drivers.sim.renderer import Renderer
from drivers.sim.scenarios import scenario
from drivers.sim.world import build


def still(path: str, name: str = "demo", seconds: float = 20.0) -> None:
    """Write the picture at a walk time."""
    world = build(scenario(name))
    renderer = Renderer(world.scene, world.trajectory, Camera(), world.config.seed)
    cv2.imwrite(path, cv2.cvtColor(renderer.render(round(seconds * 1e9)), cv2.COLOR_RGB2BGR))


if __name__ == "__main__":
    arguments = dict(zip(("path", "name"), sys.argv[1:3], strict=False))
    still(**arguments, seconds=float((sys.argv[3:4] or ["20"])[0]))
