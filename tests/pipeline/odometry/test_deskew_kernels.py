import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.odometry.deskew_kernels import deskew


def test_a_standing_point_lands_in_one_place_whenever_it_was_seen():
    spin, velocity, lever = np.array([0.3, -0.8, 2.0]), np.array([1.5, -0.4, 0.2]), np.array([-0.011, -0.023, 0.044])
    knot_s = np.linspace(0.0, 0.1, 21)
    bodies = Rotation.from_rotvec(knot_s[:, None] * spin)
    knots = np.zeros((21, 22))
    knots[:, 0], knots[:, 1:10] = knot_s, bodies.as_matrix().reshape(-1, 9)
    knots[:, 10:13], knots[:, 13:16], knots[:, 19:22] = knot_s[:, None] * velocity, velocity, spin
    seen_s = np.array([0.0, 0.0123, 0.05, 0.0999, 0.031])  # unsorted
    point = np.array([4.0, -2.0, 1.0])
    then = Rotation.from_rotvec(seen_s[:, None] * spin)
    xyz = then.inv().apply(point - seen_s[:, None] * velocity) - lever
    moved = deskew(xyz.astype(np.float32), seen_s, knots, np.eye(3), lever)
    expected = bodies[-1].inv().apply(point - 0.1 * velocity)
    np.testing.assert_allclose(moved, np.tile(expected, (5, 1)), atol=2e-6)
