"""Renders the scene as the camera sees it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from drivers.sim import render_kernels as kernels
from drivers.sim.background_kernels import paint_background
from drivers.sim.camera import Camera
from drivers.sim.forest import LITTER, SOIL
from drivers.sim.scene import Boxes, Doubles, Foliage, Scene
from drivers.sim.sprites import SIZES_PX, draw_sprites
from drivers.sim.textures import TILE_M, paint_textures

NEARBY_M = 41.0
RENEW_M = 3.0
"""What is near is looked up again after moving this far; the margin to `FAR_M` covers it."""
BRANCH_REACH_M = 14.0
MOST_CLUMPS = 4500
"""In a thicket the near leaves hide the far ones; drawing all of them takes more than a frame has."""
SMALL_M = 18.0
"""Grass beyond this is not worth its pixels."""
_BOX_COLOUR = np.array([(150, 116, 78), (138, 112, 84), (146, 120, 90), (214, 206, 176)], dtype=np.float64)
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
_FACES = np.array([[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]])
_FACE_LIGHT = np.array([0.8, 0.8, 0.9, 0.9, 0.6, 1.1])
Picture = npt.NDArray[np.uint8]
Chosen = npt.NDArray[np.int64]
"""Rows of the scene that are near, nearest first."""


class Poses(Protocol):
    """The true motion, as far as a camera needs it."""

    def poses(self, t_ns: npt.ArrayLike) -> tuple[Doubles, Doubles]:
        """Position (n, 3) and rotation body to world (n, 3, 3)."""


class Renderer:
    """Pictures of one scene from one moving camera. Not thread-safe."""

    def __init__(self, scene: Scene, trajectory: Poses, camera: Camera, seed: int) -> None:
        self._scene = scene
        self._trajectory = trajectory
        self._camera = camera
        self._textures = paint_textures(seed)
        self._sprites = draw_sprites(seed)
        self._sizes = np.array(SIZES_PX)
        self._half_m = _picture_half_m(scene.foliage)
        self._faces, self._face_colours = _box_faces(scene.boxes)
        self._rgb = np.zeros((camera.height_px, camera.width_px, 3), dtype=np.uint8)
        self._depth = np.zeros((camera.height_px, camera.width_px), dtype=np.float32)
        self._alone_rgb = np.zeros_like(self._rgb)
        self._alone = np.zeros_like(self._depth)
        self._turn: Doubles = np.eye(3)
        self._eye: Doubles = np.zeros(3)
        self._near_at: Doubles = np.full(2, np.inf)
        self._stems: Chosen = np.empty(0, dtype=np.int64)
        self._branches: Chosen = self._stems
        self._foliage: Chosen = self._stems

    @property
    def depth_m(self) -> npt.NDArray[np.float32]:
        """Depth (h, w) of the last picture along the optical axis; `kernels.NOTHING_M` where nothing is near."""
        return self._depth

    @property
    def eye_m(self) -> Doubles:
        """(3,) where the camera was at the last picture, in the world."""
        return self._eye

    def render(self, t_ns: int) -> Picture:
        """RGB (h, w, 3) at a walk time. The array is used again for the next picture."""
        position, rotation = self._trajectory.poses([t_ns])
        self._eye = position[0] + rotation[0] @ np.asarray(self._camera.position_m)
        self._turn = np.ascontiguousarray((rotation[0] @ self._camera.rotation).T)
        self._look_around(self._eye)
        view = (self._rgb, self._depth, self._camera.lens, self._turn, self._eye)
        self._paint_ground(view)
        kernels.draw_faces(*view, self._faces, self._face_colours)
        self._draw_plants(view, self._stems, self._branches, self._foliage)
        return self._rgb

    def depth_alone_m(self, tree: int) -> npt.NDArray[np.float32]:
        """Depth (h, w) of one tree as the last picture would have it if nothing else stood there.

        The picture shows the tree where this is no more than `depth_m`. The array is used again for the next tree.
        """
        self._alone.fill(kernels.NOTHING_M)
        view = (self._alone_rgb, self._alone, self._camera.lens, self._turn, self._eye)
        wood = self._branches[self._scene.branches.tree[self._branches] == tree]
        leaves = self._foliage[self._scene.foliage.tree[self._foliage] == tree]
        self._draw_plants(view, self._stems[self._stems == tree], wood, leaves)
        return self._alone

    def _paint_ground(self, view: tuple[npt.NDArray[np.generic], ...]) -> None:
        terrain, textures = self._scene.terrain, self._textures
        paint_background(
            *view,
            terrain.height_m,
            *terrain.origin_m,
            terrain.cell_m,
            self._scene.ground,
            textures.litter,
            textures.soil,
            textures.far,
            TILE_M,
            0.5 * (SOIL + LITTER),
        )

    def _draw_plants(
        self, view: tuple[npt.NDArray[np.generic], ...], some_stems: Chosen, some_wood: Chosen, some_leaves: Chosen
    ) -> None:
        stems, wood, leaves, bark = self._scene.stems, self._scene.branches, self._scene.foliage, self._textures.bark
        kernels.draw_stems(
            *view,
            some_stems,
            stems.base_m,
            stems.top_m,
            stems.radius_base_m,
            stems.radius_top_m,
            stems.species,
            stems.tape_m,
            bark,
        )
        wood_arrays = (wood.start_m, wood.end_m, wood.radius_m, wood.species)
        kernels.draw_branches(*view, some_wood, *wood_arrays, bark, BRANCH_REACH_M)
        sprites = (self._sprites.rgba, self._sprites.start, self._sizes)
        kernels.draw_foliage(*view, some_leaves, leaves.centre_m, self._half_m, leaves.species, *sprites)

    def _look_around(self, eye: Doubles) -> None:
        """Choose what is near, nearest first, so that most of what is hidden is never drawn."""
        if np.hypot(*(eye[:2] - self._near_at)) < RENEW_M:
            return
        self._near_at = eye[:2].copy()
        leaves = self._scene.foliage
        reach = np.where(leaves.semi_axes_m[:, 0] < 0.7, np.where(leaves.tree < 0, SMALL_M, NEARBY_M), NEARBY_M)
        self._stems = _nearest(self._scene.stems.base_m, eye, NEARBY_M)
        self._branches = _nearest(self._scene.branches.start_m, eye, BRANCH_REACH_M + 2.0 * RENEW_M)
        self._foliage = _nearest(leaves.centre_m, eye, reach)[:MOST_CLUMPS]


def _nearest(points: npt.NDArray[np.floating], eye: Doubles, reach_m: npt.ArrayLike) -> Chosen:
    distance = np.hypot(points[:, 0] - eye[0], points[:, 1] - eye[1])
    near = np.flatnonzero(distance < reach_m)
    return near[np.argsort(distance[near])]


def _picture_half_m(leaves: Foliage) -> npt.NDArray[np.float32]:
    """Half width and height of each clump's picture: its fronds reach out of it where it has any."""
    half = np.maximum(leaves.semi_axes_m * np.array([1.1, 1.2], np.float32), leaves.frond_m[:, None])
    return np.ascontiguousarray(half, dtype=np.float32)


def _box_faces(boxes: Boxes) -> tuple[Doubles, Doubles]:
    """All faces of all boxes as quads (6 n, 4, 3) with a colour each (6 n, 3)."""
    count = len(boxes.yaw_rad)
    corners = _CORNERS[None] * boxes.half_m[:, None, :].astype(np.float64)
    cos, sin = np.cos(boxes.yaw_rad)[:, None], np.sin(boxes.yaw_rad)[:, None]
    x = corners[..., 0] * cos - corners[..., 1] * sin
    y = corners[..., 0] * sin + corners[..., 1] * cos
    world = np.stack([x, y, corners[..., 2]], axis=-1) + boxes.centre_m[:, None, :]
    faces = world[:, _FACES].reshape(6 * count, 4, 3)
    colours = _BOX_COLOUR[boxes.made][:, None, :] * _FACE_LIGHT[None, :, None]
    return np.ascontiguousarray(faces), np.minimum(colours.reshape(-1, 3), 255.0)
