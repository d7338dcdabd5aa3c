import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.odometry import so3

turns = st.lists(st.floats(-1.7, 1.7), min_size=3, max_size=3).map(np.array)


@given(turns)
def test_exponential_and_logarithm_are_scipys(v):
    rotation = so3.exp(v)
    np.testing.assert_allclose(rotation, Rotation.from_rotvec(v).as_matrix(), atol=1e-9)
    np.testing.assert_allclose(so3.log(rotation), v, atol=1e-6)


@given(turns)
def test_right_jacobian_is_the_derivative(v):
    small = np.array([1e-6, -2e-6, 1.5e-6])
    moved = Rotation.from_rotvec(v).inv() * Rotation.from_rotvec(v + small)
    np.testing.assert_allclose(so3.right_jacobian(v) @ small, moved.as_rotvec(), atol=1e-10)
    np.testing.assert_allclose(so3.right_jacobian(v) @ so3.right_jacobian_inverse(v), np.eye(3), atol=1e-7)
