import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.odometry.vote_kernels import votes


@given(st.integers(0, 2**32 - 1), st.integers(0, 3), st.integers(0, 2))
def test_votes_are_the_overlap_of_each_shift(seed, across, up):
    """Oracle: shifted copies on a grid with a margin."""
    random = np.random.default_rng(seed)
    occupied = random.random((7, 6, 5)) < 0.3
    cells = np.argwhere(random.random((7, 6, 5)) < 0.2).astype(np.int32)
    margin = across + up
    wide = np.pad(occupied, margin)
    expected = [
        [
            [wide[tuple((cells + np.array([i, j, k]) + margin).T)].sum() for k in range(-up, up + 1)]
            for j in range(-across, across + 1)
        ]
        for i in range(-across, across + 1)
    ]
    np.testing.assert_array_equal(votes(occupied, cells, across, up), expected)
