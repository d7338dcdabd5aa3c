"""Rays end where brute force says; the pattern never repeats; what comes back looks like a Mid-360's."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from drivers.sim import forest, paths
from drivers.sim.forest_config import preset
from drivers.sim.lidar import LEVER_M, Lidar, LidarConfig
from drivers.sim.ray_grid import ray_grid
from drivers.sim.ray_kernels import LEAF, trace_many
from drivers.sim.scenarios import WorldConfig
from drivers.sim.scene import Scene
from drivers.sim.world import build

S = 1_000_000_000
CLEAN = LidarConfig(range_sigma_m=0.0, range_growth=0.0, angle_sigma_deg=0.0, particles_per_slot=0.0, glued_edges=0.0)
FIELDS = ("centre_m", "semi_axes_m", "extinction_per_m", "reflectivity", "species", "kind", "tree", "frond", "frond_m")


def _with_foliage(scene: Scene, keep: slice, extinction: float) -> Scene:
    part = {name: getattr(scene.foliage, name)[keep] for name in FIELDS}
    leaves = type(scene.foliage)(**part)
    return replace(scene, foliage=replace(leaves, extinction_per_m=np.full(len(leaves), extinction, np.float32)))


def _frustum(origin, direction, ends, radii):
    """Distance along a ray to a cone without caps, from outside; infinite for a miss. Roots found by numpy."""
    (base, top), (radius, radius_top) = ends, radii
    length = np.linalg.norm(top - base)
    axis, taper, offset = (top - base) / length, (radius_top - radius) / length, origin - base
    along = np.array([direction @ axis, offset @ axis])
    radial = np.array([taper * along[0], radius + taper * along[1]])
    square = np.array([1.0, 2.0 * offset @ direction, offset @ offset])
    roots = np.roots(square - np.convolve(along, along) - np.convolve(radial, radial))
    reals = sorted(root.real for root in roots if abs(root.imag) < 1e-12 and root.real > 1e-3)
    return next((t for t in reals if 0.0 <= np.polyval(along, t) <= length), np.inf)


def _ground(scene, origin, direction, reach):
    """First crossing of the ground by small steps and bisection."""
    t = np.arange(0.0, reach, 0.02)
    points = origin + t[:, None] * direction
    below = np.flatnonzero(points[:, 2] < scene.terrain.height_at(points[:, :2]))
    low = np.array(scene.terrain.origin_m)
    high = low + np.array(scene.terrain.height_m.shape[::-1]) - 1.0
    if not len(below) or (points[below[0], :2] < low).any() or (points[below[0], :2] > high).any():
        return np.inf
    low, high = t[max(below[0] - 1, 0)], t[below[0]]
    for _ in range(40):
        middle = 0.5 * (low + high)
        point = origin + middle * direction
        if point[2] < scene.terrain.height_at(point[:2])[0]:
            high = middle
        else:
            low = middle
    return high


def _ellipsoid(origin, direction, centre, wide, tall):
    shrink = np.array([wide, wide, tall])
    p, d = (origin - centre) / shrink, direction / shrink
    a, b, c = d @ d, p @ d, p @ p - 1.0
    disc = b * b - a * c
    if c < 0:
        return 0.001
    return (-b - np.sqrt(disc)) / a if disc > 0 and b < 0 else np.inf


def _box(origin, direction, centre, half, yaw):
    turn = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    p, d = turn @ (origin - centre), turn @ direction
    first, second = (-half - p) / d, (half - p) / d
    enter, leave = np.minimum(first, second).max(), np.maximum(first, second).min()
    return enter if 1e-3 < enter <= leave else np.inf


@pytest.fixture(scope="module")
def small():
    """A scene of every kind of thing, few enough for brute force; clumps are solid."""
    config = replace(preset("mixed", 3), corridor_m=14.0)
    return _with_foliage(forest.grow(config, paths.route("loop", 40.0, 3)), slice(None, None, 9), 1e9)


def _rays(count: int):
    rng = np.random.default_rng(8)
    directions = rng.normal(size=(count, 3)) * (1.0, 1.0, 0.45)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    places = paths.route("loop", 40.0, 3).points_m[rng.integers(0, 150, count)]
    return np.column_stack([places, np.full(count, 1.5)]), directions


def _brute_force(scene, origin, direction):
    nearest = _ground(scene, origin, direction, 60.0)
    stems, wood, leaves, boxes = scene.stems, scene.branches, scene.foliage, scene.boxes
    axes = [(stems.base_m, stems.top_m, stems.radius_base_m, stems.radius_top_m)]
    axes.append((wood.start_m, wood.end_m, wood.radius_m, wood.radius_m))
    for base, top, radius, radius_top in axes:
        far = _line_distance(origin, direction, base.astype(float), top.astype(float))
        for k in np.flatnonzero(far < radius + 0.01):
            ends, radii = (base[k].astype(float), top[k].astype(float)), (float(radius[k]), float(radius_top[k]))
            nearest = min(nearest, _frustum(origin, direction, ends, radii))
    for centre, (wide, tall) in zip(leaves.centre_m.astype(float), leaves.semi_axes_m.astype(float), strict=True):
        nearest = min(nearest, _ellipsoid(origin, direction, centre, wide, tall))
    for k in range(len(boxes.yaw_rad)):
        half = boxes.half_m[k].astype(float)
        nearest = min(nearest, _box(origin, direction, boxes.centre_m[k].astype(float), half, float(boxes.yaw_rad[k])))
    return nearest


def _line_distance(origin, direction, a, b):
    """Distance of infinite lines a-b to the ray's line."""
    normal = np.cross(b - a, direction)
    size = np.linalg.norm(normal, axis=1)
    return np.abs(np.einsum("ij,ij->i", origin - a, normal)) / np.maximum(size, 1e-9)


def test_rays_end_where_brute_force_says(small):
    origins, directions = _rays(250)
    origins[:, 2] += small.terrain.height_at(origins[:, :2])
    got, kind = trace_many(ray_grid(small), origins, directions, 60.0, np.arange(250, dtype=np.uint64))
    want = np.array([_brute_force(small, o, d) for o, d in zip(origins, directions, strict=True)])
    inside = np.isfinite(want) & (want < 60.0)
    assert inside.sum() > 120
    assert len(set(kind[inside].tolist())) >= 3
    agree = np.abs(got[inside] - want[inside]) < 2e-3
    assert agree.mean() > 0.995, "float32 solids may lose a grazing ray"
    assert (got[~inside] == 60.0).all()


def test_beams_survive_leaves_by_the_law_of_beer(small):
    scene = _with_foliage(small, slice(0, 1), 0.9)
    centre, (wide, _) = scene.foliage.centre_m[0].astype(float), scene.foliage.semi_axes_m[0].astype(float)
    count = 20_000
    direction = np.array([0.0, 0.0, -1.0])
    off = 0.3 * wide
    origins = np.tile(centre + np.array([off, 0.0, 8.0]), (count, 1))
    bare = replace(scene, stems=_none(scene.stems), branches=_none(scene.branches))
    distance, kind = trace_many(
        ray_grid(bare), origins, np.tile(direction, (count, 1)), 50.0, np.arange(count, dtype=np.uint64) * np.uint64(77)
    )
    chord = 2.0 * float(scene.foliage.semi_axes_m[0, 1]) * np.sqrt(1.0 - 0.3**2)
    stopped = kind == LEAF
    assert 1.0 - stopped.mean() == pytest.approx(np.exp(-0.9 * chord), abs=0.015)
    assert np.abs(distance[stopped] - 8.0).max() <= 0.5 * chord + 1e-3


def _none(solids):
    return type(solids)(**{name: getattr(solids, name)[:0] for name in solids.__dataclass_fields__})


@pytest.fixture(scope="module")
def world():
    return build(WorldConfig(seed=7))


def _lidar(world, config=None, seed=7):
    return Lidar(world.grid, world.trajectory, config or LidarConfig(), seed)


def test_the_same_slots_come_back_however_they_are_asked_for(world):
    t = 20 * S
    whole = _lidar(world).cast(t, 960)
    lidar = _lidar(world)
    lidar.cast(31 * S, 96)
    parts = [lidar.cast(t + k * 96 * 5_000, 96) for k in range(10)]
    for name in ("xyz_mm", "reflectivity", "tag"):
        np.testing.assert_array_equal(getattr(whole, name), np.concatenate([getattr(part, name) for part in parts]))
    other = _lidar(world, seed=8).cast(t, 960)
    assert not np.array_equal(whole.xyz_mm, other.xyz_mm)


def test_a_cast_may_span_seconds_and_any_size(world):
    lidar = _lidar(world)
    long = lidar.cast(19 * S + 900_000_000, 60_000)
    tail = lidar.cast(20 * S + 100_000_000, 20_000)
    np.testing.assert_array_equal(long.xyz_mm[40_000:], tail.xyz_mm)


def test_each_point_is_cast_from_the_pose_at_its_own_time(world):
    """While walking: put back into the world by exact poses, clean points lie on what a ray from there meets."""
    t = 20 * S
    block = _lidar(world, CLEAN).cast(t, 20_000)
    xyz = block.xyz_mm / 1000.0
    distance = np.linalg.norm(xyz, axis=1)
    position, rotation = world.trajectory.poses(t + 5_000 * np.arange(20_000))
    origins = position + rotation @ np.array(LEVER_M)
    hit = distance > 2.0
    directions = np.einsum("nij,nj->ni", rotation[hit], xyz[hit] / distance[hit, None])
    bare = replace(world.scene, foliage=_none(world.scene.foliage))
    again, _ = trace_many(ray_grid(bare), origins[hit], directions, 100.0, np.zeros(hit.sum(), np.uint64))
    near = np.abs(again - distance[hit]) < 0.02
    assert near.mean() > 0.30, "what is not leaves"
    assert (again > distance[hit] - 0.05).mean() > 0.99, "leaves only ever shorten"


def _angles(block):
    x, y, z = block.xyz_mm.T / 1000.0
    r = np.sqrt(x * x + y * y + z * z)
    seen = r > 1.0
    return np.degrees(np.arctan2(y, x))[seen], np.degrees(np.arcsin(z[seen] / r[seen])), np.flatnonzero(seen)


def test_pattern_has_the_measured_field_of_view_and_speed(world):
    azimuth, elevation, slot = _angles(_lidar(world, CLEAN).cast(5 * S, 40_000))
    assert -8.0 < elevation.min() < -5.0
    assert 45.0 < elevation.max() < 54.0
    together = np.diff(slot) == 1
    step = (np.diff(azimuth)[together] + 180.0) % 360.0 - 180.0
    assert np.median(step) == pytest.approx(0.3262, abs=0.02)


def test_sweeps_do_not_repeat_and_their_phase_steps_are_irregular(world):
    lidar = _lidar(world, CLEAN)
    phases = []
    for k in range(12):
        azimuth, _, slot = _angles(lidar.cast(2 * S + k * 100_000_000, 400))
        phases.append(np.median((azimuth - 0.3262 * slot + 180.0) % 360.0 - 180.0))
    steps = (np.diff(phases) + 180.0) % 360.0 - 180.0
    assert np.ptp(np.diff(steps)) > 2.0
    rolled = [_occupied(lidar.cast(3 * S + k * 100_000_000, 20_000)) for k in range(4)]
    for one, two in pairwise(rolled):
        assert (one & two).sum() < 0.7 * one.sum(), "consecutive sweeps look elsewhere"


def _occupied(block):
    azimuth, elevation, _ = _angles(block)
    grid = np.zeros((720, 124), bool)
    grid[((azimuth + 180.0) * 2).astype(int) % 720, ((elevation + 9.0) * 2).astype(int)] = True
    return grid


@pytest.mark.parametrize(("name", "low", "high"), [("mixed", 0.30, 0.55), ("open_trail", 0.40, 0.70)])
def test_share_of_no_returns_is_that_of_a_forest(name, low, high):
    lidar = build(WorldConfig(forest=name, length_m=60.0)).lidar
    blocks = [lidar.cast(t * S, 20_000) for t in (5, 20, 35)]
    empty = np.concatenate([(block.xyz_mm == 0).all(axis=1) for block in blocks])
    assert low < empty.mean() < high
    lost = np.concatenate([block.reflectivity for block in blocks])[empty]
    assert (lost == 0).mean() > 0.95
    assert set(np.unique(np.concatenate([block.tag for block in blocks])[empty])) <= {0, 128, 192}


def test_ranges_obey_blind_zone_and_horizon(world):
    block = _lidar(world).cast(25 * S, 40_000)
    r = np.linalg.norm(block.xyz_mm / 1000.0, axis=1)
    assert r[r > 0].min() >= 0.099
    assert r.max() < 100.0
    assert (r > 30.0).sum() > 50


def test_noise_is_within_the_data_sheet(world):
    """At rest the same slots are cast with and without range noise: 2 cm at 10 m at most, one sigma."""
    t, count = 5 * S, 40_000
    clean = np.linalg.norm(_lidar(world, CLEAN).cast(t, count).xyz_mm / 1000.0, axis=1)
    noisy = np.linalg.norm(
        _lidar(world, replace(LidarConfig(), angle_sigma_deg=0.0)).cast(t, count).xyz_mm / 1000.0, axis=1
    )
    both = (clean > 9.0) & (clean < 11.0) & (noisy > 0) & (np.abs(noisy - clean) < 0.06)
    assert both.sum() > 500
    assert 0.010 < (noisy - clean)[both].std() < 0.02


def test_tape_shines_and_nothing_else_does(world):
    scene = world.scene
    taped = np.flatnonzero(scene.trees.taped)
    origin = world.trajectory.position(5 * S, LEVER_M)
    away = np.linalg.norm(scene.trees.position_m[taped, :2] - origin[:2], axis=1)
    assert away.min() < 25.0
    blocks = [_lidar(world).cast(k * S, 40_000) for k in range(2, 9)]
    xyz = np.concatenate([block.xyz_mm for block in blocks]) / 1000.0
    bright = np.concatenate([block.reflectivity for block in blocks]) > 150
    assert bright.sum() >= 3
    _, rotation = world.trajectory.poses(5 * S)
    spots = origin + xyz[bright] @ rotation[0].T
    tape = scene.stems.tape_m[taped]
    across = np.linalg.norm(spots[:, None, :2] - scene.trees.position_m[None, taped, :2], axis=2)
    nearest = across.argmin(axis=1)
    assert across.min(axis=1).max() < 0.7
    assert (spots[:, 2] > tape[nearest, 0] - 0.15).all()
    assert (spots[:, 2] < tape[nearest, 1] + 0.15).all()


def test_edges_and_particles_are_tagged_now_and_then(world):
    config = replace(LidarConfig(), particles_per_slot=2e-3)
    tag = _lidar(world, config).cast(25 * S, 40_000).tag
    assert 0.002 < np.isin(tag, (1, 2)).mean() < 0.08
    assert 0.0008 < np.isin(tag, (4, 8)).mean() < 0.004
