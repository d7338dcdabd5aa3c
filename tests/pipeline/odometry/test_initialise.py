import numpy as np
import pytest

from pipeline.odometry.errors import StartRefused
from pipeline.odometry.initialise import force_scale


def readings(force):
    return np.column_stack([np.arange(50.0), np.zeros((50, 3)), np.tile(force, (50, 1))])


def test_the_unit_of_the_accelerometer_is_found_or_refused():
    assert force_scale(readings([0.1, -0.2, 9.8])) == 1.0
    assert force_scale(readings([0.01, -0.02, 0.999])) == pytest.approx(9.80665)
    with pytest.raises(StartRefused, match="unit"):
        force_scale(readings([0.0, 0.0, 32.2]))  # feet
