"""Simulated walks filmed for the detector: which ones, what is seen of them, and what is in the pictures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import av
import numpy as np
import numpy.typing as npt

from drivers.sim.boxes import TreeBoxes, tree_boxes
from drivers.sim.camera import Camera, exposure_ns
from drivers.sim.carriers import CARRIERS
from drivers.sim.forest_config import PRESETS
from drivers.sim.motion import Schedule
from drivers.sim.renderer import Renderer
from drivers.sim.scenarios import WorldConfig, scenario
from drivers.sim.species import Species
from drivers.sim.video import RenderedVideo
from drivers.sim.world import World, build

RESERVED_SEEDS = range(1, 21)
"""Of the demo and of evaluation, in every scenario: nothing is ever trained or chosen on them."""
TRAINING_SEEDS = range(1000, 1130)
VALIDATION_SEEDS = range(500, 510)
HELD_OUT = (
    "demo",
    "open_trail",
    "dense",
    "thicket",
    "slope",
    "meadow_edge",
    "plantation",
    "backpack",
    "bicycle",
    "uav",
)
Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Shot:
    """One picture as the pipeline gets it, RGB (h, w, 3), with the trees that are really in it."""

    frame: int
    picture: Picture
    boxes: TreeBoxes


def training_walk(seed: int) -> WorldConfig:
    """A short walk of that seed through any of the forests, carried by any of the carriers."""
    rng = np.random.default_rng([seed, 7])
    return WorldConfig(
        "training",
        seed,
        forest=str(rng.choice(list(PRESETS))),
        path=str(rng.choice(["loop", "out_and_back"])),
        length_m=float(rng.uniform(50.0, 90.0)),
        carrier=str(rng.choice(list(CARRIERS))),
        shake=float(rng.choice([1.0, 1.0, 3.0])),
        schedule=Schedule(rest_s=1.0, stop_s=0.0, end_s=1.0),
    )


def held_out_walk(seed: int) -> WorldConfig:
    """The scenario whose turn it is at that validation seed, 50 m at most, with a short rest before the start."""
    config = scenario(HELD_OUT[seed % len(HELD_OUT)], seed)
    return replace(config, length_m=min(config.length_m, 50.0), schedule=Schedule(rest_s=1.0, stop_s=0.0, end_s=1.0))


def sampled(config: WorldConfig, every_m: float) -> Iterator[Shot]:
    """Pictures about so far apart along the way, each the last of a short video; with Tree-of-Heaven only."""
    world = build(config)
    rng = np.random.default_rng([config.seed, 8])
    renderer = Renderer(world.scene, world.trajectory, Camera(), config.seed)
    for frame in _along(world, every_m, rng):
        step, run_up = int(rng.integers(1, 4)), int(rng.integers(1, 4))
        *_, (_, picture) = _video(renderer, range(max(frame - run_up * step, frame % step), frame + 1, step))
        yield Shot(frame, picture, tree_boxes(renderer, world.trees, species=[Species.TREE_OF_HEAVEN]))


def filmed(config: WorldConfig, every: int) -> Iterator[Shot]:
    """The whole video, of which every so many-th frame is given, with all the trees in it."""
    world = build(config)
    renderer = Renderer(world.scene, world.trajectory, Camera(), config.seed)
    for frame, picture in _video(renderer, range(world.trajectory.duration_ns // exposure_ns(1))):
        if frame % every == 0:
            yield Shot(frame, picture, tree_boxes(renderer, world.trees))


def _along(world: World, every_m: float, rng: np.random.Generator) -> list[int]:
    """Frames about `every_m` of the way apart."""
    count = world.trajectory.duration_ns // exposure_ns(1)
    position, _ = world.trajectory.poses([exposure_ns(k) for k in range(count)])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position[:, :2], axis=0), axis=1))])
    wanted = np.arange(0.0, way[-1], every_m)
    frames = np.searchsorted(way, wanted + rng.uniform(0.0, every_m, len(wanted)))
    return sorted({int(frame) for frame in frames if frame < count})


def _video(renderer: Renderer, frames: Iterable[int]) -> Iterator[tuple[int, Picture]]:
    """Frames rendered, encoded as the emulated camera does, and decoded again; the renderer is at the frame given."""
    video = RenderedVideo(renderer, Camera().width_px, Camera().height_px)
    decoder = av.CodecContext.create("h264", "r")
    decoder.thread_count = 1
    for frame in frames:
        unit, _ = video.access_unit(frame)
        (decoded,) = decoder.decode(av.Packet(unit))
        yield frame, decoded.to_ndarray(format="rgb24")
