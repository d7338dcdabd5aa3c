"""The system clock: its discipline, and steps."""

import time
from pathlib import Path

from edge.service.host_clock import STEP_NS, StepWatch, discipline, offset_ns


def test_a_step_is_seen_once_and_slewing_is_not() -> None:
    offsets = iter([0, 400_000, 800_000, -2_500_000_000, -2_500_000_000])
    watch = StepWatch(lambda: next(offsets))
    assert [watch.look() for _ in range(4)] == [0, 0, -2_500_800_000, 0]
    assert watch.steps == 1


def test_the_offset_is_utc_minus_monotonic() -> None:
    assert abs(offset_ns() - (time.time_ns() - time.monotonic_ns())) < STEP_NS


def test_the_kernel_is_believed(tmp_path: Path) -> None:
    (tmp_path / "run/chrony").mkdir(parents=True)
    (tmp_path / "run/chrony/chronyd.pid").touch()
    good = discipline(tmp_path, lambda: (0, 0x2001, 150))
    assert (good.synchronised, good.source, good.error_s) == (True, "chrony", 0.00015)
    bad = discipline(tmp_path, lambda: (5, 0x40, 16_000_000))
    assert (bad.synchronised, bad.source) == (False, "none")


def test_where_the_kernel_may_not_be_asked_timesyncd_is(tmp_path: Path) -> None:
    assert discipline(tmp_path, lambda: None).source == "unknown"
    (tmp_path / "run/systemd/timesync").mkdir(parents=True)
    (tmp_path / "run/systemd/timesync/synchronized").touch()
    told = discipline(tmp_path, lambda: None)
    assert (told.synchronised, told.source) == (True, "systemd-timesyncd")


def test_this_computer_can_be_asked() -> None:
    assert discipline().source
