import numpy as np
import pytest

from edge.process.clocks import apart

SECOND = 1_000_000_000
POSES = 1_700_000_000 * SECOND + np.arange(100, dtype=np.int64) * SECOND


@pytest.mark.parametrize(
    ("off_s", "said"),
    [(86400, "23 h 58 min after the last"), (-3600, "58 min 21 s before the first")],
)
def test_a_clock_that_is_wrong_is_told_by_how_much(off_s, said):
    words = apart(POSES + off_s * SECOND, POSES)
    assert words.startswith(f"all 100 are stamped {said} pose")
    assert f"{off_s:+d} s" in words


@pytest.mark.parametrize("stamps", [POSES[:0], POSES + 99 * SECOND, np.concatenate([POSES - 3600 * SECOND, POSES[:1]])])
def test_nothing_is_said_where_some_of_it_is_of_the_same_time(stamps):
    assert apart(stamps, POSES) == ""
    assert apart(POSES, POSES[:0]) == ""
