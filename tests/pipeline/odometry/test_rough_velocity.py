import numpy as np
import pytest

from pipeline.odometry.errors import StartRefused
from pipeline.odometry.rough_velocity import rough_velocity

TIMES_S = np.arange(10) * 0.1


def grove(random):
    """Places of stem points about the origin, 40 m wide."""
    stems = random.uniform(-25, 25, (120, 2))
    height = random.uniform(-1.0, 5.0, (120, 60))
    return np.column_stack([np.repeat(stems, 60, axis=0), height.ravel()])


@pytest.mark.parametrize("velocity", [(1.2, -0.4, 0.1), (-7.0, 9.0, 0.0), (0.0, 0.0, 3.0), (0.0, 0.0, 0.0)])
def test_the_speed_through_a_grove_is_found(velocity):
    random = np.random.default_rng(6)
    points, velocity = grove(random), np.array(velocity)
    clouds = [points[random.random(len(points)) < 0.3] - velocity * t for t in TIMES_S]
    np.testing.assert_allclose(rough_velocity(clouds, TIMES_S), velocity, atol=0.6)


def test_over_a_plain_every_speed_is_as_good():
    random = np.random.default_rng(7)
    plane = [np.column_stack([random.uniform(-30, 30, (20_000, 2)), np.full(20_000, -1.3)]) for _ in TIMES_S]
    with pytest.raises(StartRefused, match="nothing upright"):
        rough_velocity(plane, TIMES_S)


def test_three_scans_are_too_few():
    with pytest.raises(StartRefused, match="too few"):
        rough_velocity([np.zeros((5, 3))] * 3, np.arange(3) * 0.1)
