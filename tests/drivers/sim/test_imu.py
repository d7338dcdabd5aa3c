"""Readings integrate to the trajectory; noise, bias walk and saturation are those asked for."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.sim.imu import GRAVITY_M_S2, PERFECT, Imu, ImuConfig
from drivers.sim.scenarios import WorldConfig
from drivers.sim.trajectory import SPLINE_NS, Trajectory
from drivers.sim.world import build

S = 1_000_000_000
STILL = Trajectory(np.zeros((10, 6)))


def _expm(turn):
    """Rotation by a vector (Rodrigues)."""
    angle = np.linalg.norm(turn)
    x, y, z = turn / max(angle, 1e-15)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


@pytest.mark.parametrize(
    "carrier", ["handheld", *(pytest.param(name, marks=pytest.mark.slow) for name in ("bicycle", "uav"))]
)
def test_perfect_readings_integrate_to_the_trajectory(carrier):
    trajectory = build(WorldConfig(carrier=carrier)).trajectory
    imu, step = Imu(trajectory, PERFECT, 1), 1_000_000
    start = trajectory.at(18 * S)
    position, velocity, rotation = start.position_m[0], start.velocity_m_s[0], start.rotation[0]
    for t in range(18 * S, 28 * S, step):
        turn, force = imu.sample(t + step // 2)
        middle = rotation @ _expm(np.array(turn) * step * 0.5e-9)
        acceleration = middle @ np.array(force) * GRAVITY_M_S2 - (0.0, 0.0, GRAVITY_M_S2)
        position = position + velocity * step * 1e-9 + 0.5 * acceleration * (step * 1e-9) ** 2
        velocity = velocity + acceleration * step * 1e-9
        rotation = rotation @ _expm(np.array(turn) * step * 1e-9)
    end = trajectory.at(28 * S)
    np.testing.assert_allclose(position, end.position_m[0], atol=2e-3)
    np.testing.assert_allclose(rotation, end.rotation[0], atol=2e-5)


def test_upright_at_rest_reads_one_g_up():
    turn, force = Imu(STILL, PERFECT, 1).sample(5)
    np.testing.assert_allclose(turn, 0.0, atol=1e-15)
    np.testing.assert_allclose(force, (0.0, 0.0, 1.0), atol=1e-15)


def test_white_noise_is_the_density_over_the_bandwidth():
    config = replace(ImuConfig(), gyro_walk_rad_s=0.0, accel_walk_g=0.0)
    imu = Imu(STILL, config, 3)
    readings = np.array([np.concatenate(imu.sample(k * 5_000_000)) for k in range(8000)])
    np.testing.assert_allclose(readings[:, :3].std(axis=0), np.radians(4.5e-3) * 10.0, rtol=0.05)
    np.testing.assert_allclose(readings[:, 3:].std(axis=0), 100e-6 * 10.0, rtol=0.05)


def test_bias_walks_by_the_root_of_time():
    config = replace(PERFECT, gyro_walk_rad_s=1e-3, accel_walk_g=1e-3)
    steps = []
    for seed in range(60):
        imu = Imu(STILL, config, seed)
        for t in (1, 30, 100):
            imu.sample(t * S)
        steps.append(imu.bias())
    assert np.std(steps) == pytest.approx(1e-3 * 10.0, rel=0.15)


def test_saturates_at_the_range():
    fall = np.zeros((400, 6))
    fall[:, 2] = 0.5 * 200.0 * (np.arange(400) * SPLINE_NS * 1e-9) ** 2
    fall[:, 5] = 80.0 * np.arange(400) * SPLINE_NS * 1e-9
    turn, force = Imu(Trajectory(fall), PERFECT, 1).sample(S)
    assert force[2] == 4.0
    assert turn[2] == pytest.approx(np.radians(2000.0))


def test_same_seed_same_readings():
    one, two, other = (Imu(STILL, ImuConfig(), seed) for seed in (1, 1, 2))
    assert one.sample(9) == two.sample(9) != other.sample(9)
