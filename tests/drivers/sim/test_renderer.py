import numpy as np
import pytest

from drivers.sim.camera import Camera
from drivers.sim.forest import grow
from drivers.sim.forest_config import preset
from drivers.sim.paths import route
from drivers.sim.renderer import Renderer
from drivers.sim.species import Species
from drivers.sim.sprites import draw_sprites
from drivers.sim.textures import paint_textures


class Standing:
    """A carrier that looks along the world's x axis from a fixed place."""

    def __init__(self, position_m):
        self.position_m = np.asarray(position_m, dtype=np.float64)

    def poses(self, t_ns):
        return self.position_m[None], np.eye(3)[None]


@pytest.fixture(scope="module")
def scene():
    return grow(preset("open_trail", 5), route("loop", 60.0, 5))


def project(camera, eye, points):
    """Pixel and depth of world points seen along +x, written out by hand."""
    seen = points - eye
    depth = seen[:, 0]
    return camera.focal_px * -seen[:, 1] / depth, camera.focal_px * -seen[:, 2] / depth, depth


def test_stems_stand_where_the_scene_says(scene):
    camera = Camera()
    eye = np.array([0.0, 0.0, float(scene.terrain.height_at([0.0, 0.0])[0]) + 1.5])
    renderer = Renderer(scene, Standing(eye - np.asarray(camera.position_m)), camera, seed=1)
    renderer.render(0)
    stems = scene.stems
    share = (1.3 + 0.15) / (stems.top_m[:, 2] - stems.base_m[:, 2])
    breast = stems.base_m + share[:, None] * (stems.top_m - stems.base_m)
    u, v, depth = project(camera, eye, breast.astype(np.float64))
    column, row = np.rint(u + 423.5).astype(int), np.rint(v + 239.5).astype(int)
    seen = (depth > 2.0) & (depth < 25.0) & (np.abs(u) < 420) & (np.abs(v) < 235)
    drawn = renderer.depth_m[row[seen], column[seen]]
    assert seen.sum() > 5
    assert (drawn < depth[seen] + 0.3).all()  # the stem, or something that hides it
    assert np.mean(np.abs(drawn - depth[seen]) < 0.3) > 0.5


def test_ground_is_as_deep_as_a_ray_cast_by_hand(scene):
    camera = Camera()
    eye = np.array([0.0, 0.0, float(scene.terrain.height_at([0.0, 0.0])[0]) + 1.5])
    bare = Renderer(scene, Standing(eye - np.asarray(camera.position_m)), camera, seed=1)
    bare._draw_plants = lambda *_: None
    bare.render(0)
    for row, column in [(470, 100), (440, 420), (420, 700)]:
        a, b = (column - 423.5) / 432.0, (row - 239.5) / 432.0
        t = np.arange(0.5, 38.0, 0.002)
        ray = eye + t[:, None] * np.array([1.0, -a, -b])
        first = np.flatnonzero(ray[:, 2] < scene.terrain.height_at(ray[:, :2]))[0]
        assert bare.depth_m[row, column] == pytest.approx(t[first], abs=0.15)


def test_the_same_seed_gives_the_same_picture(scene):
    pictures = [Renderer(scene, Standing([0, 0, 2.0]), Camera(), seed=4).render(0).copy() for _ in range(2)]
    assert np.array_equal(*pictures)
    assert not np.array_equal(pictures[0], Renderer(scene, Standing([0, 0, 2.0]), Camera(), seed=5).render(0))


def test_tree_of_heaven_looks_different():
    textures = paint_textures(1)
    bark = textures.bark.reshape(len(textures.bark), -1)
    heaven, others = bark[Species.TREE_OF_HEAVEN], np.delete(bark, Species.TREE_OF_HEAVEN, axis=0)
    assert heaven.mean() > 1.25 * others.mean(axis=1).max()  # pale
    assert heaven.std() / heaven.mean() < 0.6 * (others[:3].std(axis=1) / others[:3].mean(axis=1)).min()  # smooth
    sprites = draw_sprites(1)
    cover = {}
    for species in (Species.TREE_OF_HEAVEN, Species.MAPLE):
        first = sprites.start[species, 0, 0]
        cover[species] = sprites.rgba[first : first + 192 * 192, 3].mean() / 255.0
    assert cover[Species.TREE_OF_HEAVEN] < 0.75 * cover[Species.MAPLE]  # loose rosettes, not closed clumps
