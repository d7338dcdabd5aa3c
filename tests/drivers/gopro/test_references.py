"""Lost pictures are seen in the numbers of those that came."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.gopro.references import References
from tests.edge.replay import videos

WITH_PYRAMID = {"x264-params": "annexb=1:repeat-headers=1:scenecut=0:b-adapt=0:bframes=3:b-pyramid=normal:ref=3"}
WITH_SCALING = {"preset": "medium", "x264-params": "annexb=1:repeat-headers=1:keyint=10:cqm=jvt"}


def misses(units) -> list[int]:
    references = References()
    return [index for index, unit in units if references.miss(unit)]


@pytest.mark.parametrize("options", [None, videos.REORDERED, WITH_PYRAMID, WITH_SCALING, {"preset": "slow"}])
def test_a_whole_stream_misses_nothing(options):
    assert misses(videos.units(80, options)) == []


@pytest.mark.parametrize("lost", [1, 4, 8, 17])
def test_the_unit_after_a_lost_one_tells(lost):
    units = [unit for unit in videos.units(30) if unit[0] != lost]
    assert misses(units) == [lost + 1]


def test_a_lost_end_of_a_group_is_no_loss_to_the_next():
    assert misses([unit for unit in videos.units(30) if unit[0] not in (8, 9)]) == []


def test_numbers_wrap_around():
    units = videos.units(400, {"g": "1000", "tune": "zerolatency", "x264-params": "annexb=1:keyint=1000:scenecut=0"})
    assert misses(units) == []
    assert misses(units[:300] + units[301:]) == [301]


@given(st.binary(max_size=80))
def test_any_bytes_are_borne(noise):
    references = References()
    for head in (b"", b"\x00\x00\x01\x67", b"\x00\x00\x01\x65", b"\x00\x00\x01\x41"):
        references.miss(head + noise)
