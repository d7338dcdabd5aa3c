"""What the fusion notices of a receiver whose stamps or places are wrong for good."""

from dataclasses import replace

import msgspec
import pytest

from pipeline.gnss.config import FusionConfig
from pipeline.gnss.fusion import GnssFusion
from pipeline.gnss.smoother import smooth
from tests.pipeline.gnss.walks import SECOND, Walk, fused, moved_by, sizes


def stamped_later(fixes, late_s):
    return [replace(fix, stamp_ns=fix.stamp_ns + int(late_s * SECOND)) for fix in fixes]


@pytest.mark.parametrize("late_s", [1.0, -0.7])
def test_wrong_stamps_are_told_live_and_afterwards(late_s):
    walk = Walk(seconds=300, size_m=20.0)
    fixes = stamped_later(walk.fixes(), late_s)
    fusion, _ = fused(walk, fixes, delay_ns=2 * SECOND)
    told = [fusion.note, *smooth(walk.estimates(), fixes, walk.config).notes]
    assert len(told) == 2
    for note in told:
        found_s = float(note.split("fusion.stamped_late_s = ")[1])
        assert found_s == pytest.approx(late_s, abs=0.2)


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_nothing_is_said_of_a_sound_receiver(seed):
    walk = Walk(seconds=300, size_m=20.0, seed=seed)
    fusion, _ = fused(walk, walk.fixes(sigma_m=1.0))
    assert fusion.note == ""
    assert smooth(walk.estimates(), walk.fixes(sigma_m=1.0), walk.config).notes == ()


@pytest.mark.parametrize("late_s", [1.0, -0.7])
def test_stamps_known_to_be_late_do_no_harm(late_s):
    walk = Walk(seconds=200)
    _, sound = fused(walk, walk.fixes())
    walk.config = msgspec.structs.replace(FusionConfig(), stamped_late_s=late_s)
    _, mended = fused(walk, stamped_later(walk.fixes(), late_s), delay_ns=2 * SECOND)
    assert sizes(mended).mean() == pytest.approx(sizes(sound).mean(), abs=0.05)


def test_who_stands_still_is_told_nothing_of_stamps():
    walk = Walk(seconds=300)
    fusion = GnssFusion()
    for stamp in walk.stamps.tolist():
        fusion.add_odometry(walk.estimate(0, stamp_ns=stamp))
    for fix in walk.fixes():
        fusion.add_fix(moved_by(fix, walk.antenna(0) - walk.antenna(fix.stamp_ns)))
    assert fusion.note == ""


def test_a_receiver_that_goes_elsewhere_for_good_is_told():
    walk = Walk(seconds=300)
    fixes = [fix if fix.stamp_ns < 150 * SECOND else moved_by(fix, [30.0, -20.0, 0.0]) for fix in walk.fixes()]
    fusion, _ = fused(walk, fixes)
    assert fusion.note.startswith("GNSS moved 36 m away")
    assert any(note.startswith("GNSS moved") for note in smooth(walk.estimates(), fixes, walk.config).notes)
