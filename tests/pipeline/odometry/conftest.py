"""One simulated walk for all: two seconds at rest, then on foot. Casting it takes longer than all else."""

import pytest

from benchmarks.odometry.faults.catalogue import cast


@pytest.fixture(scope="session")
def streams(tmp_path_factory):
    """25 s of scans and inertial samples, with the truth."""
    return cast(tmp_path_factory.mktemp("walk"), turning=False)
