"""The motion is smooth, still where it must be, and its derivatives are its derivatives."""

import numpy as np
import pytest

from drivers.errors import SimulationError
from drivers.sim.carriers import CARRIERS, carrier
from drivers.sim.scenarios import WorldConfig, scenario
from drivers.sim.world import build

S = 1_000_000_000


def _walk(name: str = "handheld", seed: int = 7, length_m: float = 60.0, path: str = "loop"):
    return build(WorldConfig(carrier=name, seed=seed, length_m=length_m, path=path))


@pytest.fixture(scope="module", params=list(CARRIERS))
def world(request):
    return _walk(request.param)


def test_velocity_and_acceleration_are_the_derivatives_of_position(world):
    t = np.arange(12 * S, 30 * S, 37_000_000) + 1_234_567
    h = 200_000
    at, before, after = (world.trajectory.at(t + step) for step in (0, -h, h))
    numeric = (after.position_m - before.position_m) / (2 * h * 1e-9)
    np.testing.assert_allclose(numeric, at.velocity_m_s, atol=1e-4)
    numeric = (after.velocity_m_s - before.velocity_m_s) / (2 * h * 1e-9)
    np.testing.assert_allclose(numeric, at.acceleration_m_s2, atol=2e-3)


def test_angular_velocity_is_the_derivative_of_rotation(world):
    t = np.arange(12 * S, 30 * S, 37_000_000) + 1_234_567
    h = 20_000
    at, before, after = (world.trajectory.at(t + step) for step in (0, -h, h))
    skew = np.swapaxes(at.rotation, 1, 2) @ (after.rotation - before.rotation) / (2 * h * 1e-9)
    numeric = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    np.testing.assert_allclose(numeric, at.angular_velocity, atol=1e-5)


def test_still_until_the_rest_is_over_and_for_ever_after_the_end(world):
    first = world.trajectory.at(np.arange(0, 10 * S, 10_000_000))
    end = world.trajectory.duration_ns
    last = world.trajectory.at(np.linspace(end - 2.9 * S, end + 900 * S, 500).astype(np.int64))
    for motion in (first, last):
        assert np.abs(motion.position_m - motion.position_m[0]).max() < 1e-9
        assert np.abs(motion.velocity_m_s).max() < 1e-9
        assert np.abs(motion.angular_velocity).max() < 1e-9
        assert np.abs(motion.acceleration_m_s2).max() < 1e-6


def test_comes_back_to_the_start_at_the_carriers_pace_with_one_stop(world):
    end = world.trajectory.duration_ns
    motion = world.trajectory.at(np.arange(0, end, 20_000_000))
    speed = np.linalg.norm(motion.velocity_m_s[:, :2], axis=1)
    assert np.linalg.norm(motion.position_m[-1] - motion.position_m[0]) < 0.2
    assert 0.6 * world.carrier.speed_m_s < np.median(speed[speed > 0.3]) < 1.2 * world.carrier.speed_m_s
    flown = np.trapezoid(speed, dx=0.02) if hasattr(np, "trapezoid") else np.trapz(speed, dx=0.02)
    assert flown == pytest.approx(world.route.length_m, rel=0.15)
    east, north = (np.convolve(motion.velocity_m_s[:, k], np.ones(100) / 100, mode="same") for k in (0, 1))
    slow = np.hypot(east, north) < 0.3
    pauses = np.flatnonzero(np.diff(slow.astype(int)) == 1)
    assert len(pauses) == 2, "one on the way, one at the end"


def test_keeps_above_the_ground_it_walks_on():
    world = _walk("handheld")
    motion = world.trajectory.at(np.arange(0, world.trajectory.duration_ns, 50_000_000))
    above = motion.position_m[:, 2] - world.terrain.height_at(motion.position_m[:, :2])
    assert abs(np.mean(above) - world.carrier.height_m) < 0.05
    assert np.abs(above - world.carrier.height_m).max() < 0.25


def test_uav_climbs_and_lands():
    world = _walk("uav")
    motion = world.trajectory.at(np.arange(0, world.trajectory.duration_ns, 50_000_000))
    above = motion.position_m[:, 2] - world.terrain.height_at(motion.position_m[:, :2])
    assert above[0] == pytest.approx(above[-1], abs=0.05)
    assert above.max() > 3.0


def test_walkers_bob_at_the_frequency_of_their_steps():
    world = _walk("backpack", length_m=200.0)
    t = np.arange(20 * S, 60 * S, 10_000_000)
    up = world.trajectory.at(t).acceleration_m_s2[:, 2]
    spectrum = np.abs(np.fft.rfft(up * np.hanning(len(up))))
    assert np.fft.rfftfreq(len(up), 0.01)[spectrum.argmax()] == pytest.approx(world.carrier.step_hz, rel=0.12)


def test_quaternions_are_the_rotation():
    trajectory = _walk().trajectory
    t = np.arange(0, 40 * S, 777_000_000)
    x, y, z, w = trajectory.quaternions(t).T
    _, rotation = trajectory.poses(t)
    np.testing.assert_allclose(rotation[:, 2, 1] - rotation[:, 1, 2], 4 * w * x, atol=1e-12)
    np.testing.assert_allclose(rotation[:, 1, 0] - rotation[:, 0, 1], 4 * w * z, atol=1e-12)
    np.testing.assert_allclose(rotation[:, 0, 2] - rotation[:, 2, 0], 4 * w * y, atol=1e-12)
    np.testing.assert_allclose(x * x + y * y + z * z + w * w, 1.0, atol=1e-12)


def test_a_lever_swings_with_the_body():
    walk, lever, h = _walk().trajectory, (0.1, -0.2, 0.6), 100_000
    for t in (14 * S, 25 * S + 3):
        numeric = (walk.position(t + h, lever) - walk.position(t - h, lever)) / (2 * h * 1e-9)
        np.testing.assert_allclose(walk.velocity(t, lever), numeric, atol=1e-5)


def test_same_seed_same_walk_other_seed_another():
    t = np.arange(0, 40 * S, 500_000_000)
    one, two, other = (_walk(seed=seed).trajectory.at(t).position_m for seed in (7, 7, 8))
    np.testing.assert_array_equal(one, two)
    assert np.abs(one - other).max() > 1.0


def test_unknown_carrier_is_refused():
    with pytest.raises(SimulationError, match="handheld"):
        carrier("horse")


def test_who_calibrates_stands_at_six_places_and_rolls_the_payload_at_every_second():
    world = build(scenario("standing"))
    t = np.arange(7 * S, world.trajectory.duration_ns - 4 * S, S // 10)
    at = world.trajectory.at(t)
    still = np.linalg.norm(at.velocity_m_s, axis=1) < 0.05
    roll_deg = np.degrees(np.arctan2(at.rotation[:, 2, 1], at.rotation[:, 2, 2]))
    places = np.split(np.flatnonzero(still), np.flatnonzero(np.diff(np.flatnonzero(still)) > 20) + 1)
    held = [np.median(roll_deg[place]) for place in places if len(place) > 40]
    np.testing.assert_allclose(held, [0.0, 60.0, 0.0, -60.0, 0.0, 60.0], atol=3.0)
