"""No image of one split is a neighbour of an image of another, and what leaks when that is forced is said."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.dataset.blocks import BlockSize, find_blocks
from pipeline.dataset.errors import SplitRefused
from pipeline.dataset.neighbours import Gap, leaks
from pipeline.dataset.record import GAP, ImageRecord
from pipeline.dataset.split import Rules, divide

LATITUDE = 40.0
DEGREE_M = 111_320.0
S = 1_000_000_000
PICTURES = [f"{word:016x}" for word in np.random.default_rng(1).integers(0, 2**63, 60).tolist()]


def image(name: str, **fields) -> ImageRecord:
    return ImageRecord(image=f"{name}.jpg", sha256=name, width_px=848, height_px=480, **fields)


def frame(k: int, east_m: float, north_m: float = 0.0, *, session: str = "walk", site: str = "wood") -> ImageRecord:
    """Every 2 m one, on a walk at 1 m/s."""
    place = {
        "latitude_deg": LATITUDE + north_m / DEGREE_M,
        "longitude_deg": 8.0 + east_m / DEGREE_M / math.cos(math.radians(LATITUDE)),
    }
    return image(f"{session}-{k}", source="field", site=site, session=session, stamp_ns=k * 2 * S, **place)


def line(count: int, **named) -> list[ImageRecord]:
    return [frame(k, 2.0 * k, **named) for k in range(count)]


def splits(division) -> list[str]:
    return [record.split for record in division.records]


def apart_m(one: ImageRecord, other: ImageRecord) -> float:
    north = (one.latitude_deg - other.latitude_deg) * DEGREE_M
    east = (one.longitude_deg - other.longitude_deg) * DEGREE_M * math.cos(math.radians(LATITUDE))
    return math.hypot(east, north)


def test_a_walk_is_divided_in_blocks_with_a_gap_between_splits():
    records = line(400)
    division = divide(records, [1] * 400, Rules())
    inside = [record for record in division.records if record.split != GAP]
    closest = min(apart_m(a, b) for a in inside for b in inside if a.split != b.split)
    assert closest > 19.9
    assert division.leaks == []
    assert set(splits(division)) == {"train", "val", "test", GAP}
    assert division.set_aside == splits(division).count(GAP)


def test_two_sessions_over_the_same_ground_share_their_splits():
    records = line(300) + [frame(k, 2.0 * k + 0.7, 3.0, session="again") for k in range(300)]
    division = divide(records, [None] * 600, Rules())
    assert division.leaks == []
    there, again = splits(division)[:300], splits(division)[300:]
    parted = [(a, b) for a, b in zip(there, again, strict=True) if GAP not in (a, b) and a != b]
    assert parted == []


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 7))])
def test_shares_are_met_for_each_source_and_the_same_seed_divides_the_same(seed):
    records = line(1500) + [image(f"photo{k}", source="inaturalist", group=f"observation {k // 2}") for k in range(400)]
    rules = Rules(seed=seed)
    division = divide(records, [2] * len(records), rules)
    for part in (slice(0, 1500), slice(1500, None)):
        found = splits(division)[part]
        assert found.count("test") / len(found) == pytest.approx(0.1, abs=0.04)
        assert found.count("val") / len(found) == pytest.approx(0.1, abs=0.04)
    assert splits(divide(records, [2] * len(records), rules)) == splits(division)
    assert splits(divide(records, [2] * len(records), Rules(seed=seed + 1))) != splits(division)


@settings(max_examples=25)
@given(st.integers(0, 2**31), st.sampled_from(["block", "site"]))
def test_whatever_the_images_nothing_leaks(seed, by):
    rng = np.random.default_rng(seed)
    records = []
    for k in range(120):
        fields = {"site": f"site{rng.integers(6)}", "session": f"s{rng.integers(4)}"}
        fields["stamp_ns"] = int(rng.integers(900)) * S
        if rng.random() < 0.6:
            fields |= {"latitude_deg": 40 + rng.random() * 3e-3, "longitude_deg": 8 + rng.random() * 3e-3}
        if rng.random() < 0.3:
            fields["group"] = f"g{rng.integers(15)}"
        if rng.random() < 0.3:
            fields["phash"] = f"{rng.integers(20):016x}"
        records.append(image(f"{k}", source="field", **fields))
    rules = Rules(by=by, seed=seed, size=BlockSize(30.0, 30.0), gap=Gap(8.0, 5.0))
    try:
        division = divide(records, [1] * 120, rules)
    except SplitRefused:  # everything hangs together
        return
    assert division.leaks == []
    assert leaks(division.records, rules.gap) == []


def test_an_observation_and_pictures_that_are_alike_stay_together():
    records = [image(f"p{k}", group=f"observation {k // 4}", phash=PICTURES[k % 60]) for k in range(80)]
    division = divide(records, [1] * 80, Rules(by="image", shares=(0.6, 0.2, 0.2)))
    for k in range(0, 80, 4):
        assert len(set(splits(division)[k : k + 4])) == 1
    assert splits(division)[60:] == splits(division)[:20]
    assert division.leaks == []


def test_of_many_draws_the_one_that_loses_least_is_taken():
    small = divide(line(100), [1] * 100, Rules(shares=(0.6, 0.2, 0.2)))
    counts = [splits(small).count(name) for name in ("train", "val", "test")]
    assert min(counts) > 0
    assert small.set_aside <= 40  # at most two borders of 20 m, each ten images wide


def test_without_positions_a_session_is_divided_in_time():
    records = [image(f"t{k}", session="walk", stamp_ns=k * S) for k in range(1000)]
    division = divide(records, [1] * 1000, Rules())
    inside = [record for record in division.records if record.split != GAP]
    closest = min(abs(a.stamp_ns - b.stamp_ns) for a in inside for b in inside if a.split != b.split)
    assert closest > 20 * S
    assert division.loose == 0


def test_images_without_place_and_time_are_counted():
    records = [image(f"x{k}") for k in range(30)]
    assert divide(records, [1] * 30, Rules()).loose == 30


def test_sites_stay_whole_and_a_site_can_be_held_out():
    records = [frame(k, 1000.0 * n + 2 * k, site=f"site{n}", session=f"s{n}") for n in range(5) for k in range(50)]
    division = divide(records, [1] * 250, Rules(by="site", shares=(0.6, 0.2, 0.2)))
    by_site = [set(splits(division)[n * 50 : n * 50 + 50]) for n in range(5)]
    assert all(len(one) == 1 for one in by_site)
    assert sorted(next(iter(one)) for one in by_site) == ["test", "train", "train", "train", "val"]
    held = divide(records, [1] * 250, Rules(by="site", shares=(0.8, 0.2, 0.0), test_sites=["site2"]))
    assert set(splits(held)[100:150]) == {"test"}
    assert "test" not in splits(held)[:100] + splits(held)[150:]


def test_a_position_that_is_blurred_says_nothing():
    here = {"latitude_deg": 40.0, "longitude_deg": 8.0, "obscured": True}
    records = [image(f"o{k}", source="inaturalist", group=f"{k}", **here) for k in range(50)]
    assert len(find_blocks(records, "block", BlockSize())) == 50
    assert divide(records, [1] * 50, Rules()).set_aside == 0


def test_a_source_can_be_kept_for_training():
    records = line(300) + [image(f"i{k}", source="inaturalist", group=f"{k}") for k in range(50)]
    assert set(splits(divide(records, [1] * 350, Rules(train_only=["inaturalist"])))[300:]) == {"train"}


def test_forced_division_keeps_every_image_and_says_what_leaks():
    records = line(60)
    division = divide(records, [1] * 60, Rules(by="image", gap=Gap(21.0), force=True))
    assert division.set_aside == 0
    brute = {
        (i, j)
        for i in range(60)
        for j in range(i + 1, 60)
        if apart_m(records[i], records[j]) <= 21.0 and splits(division)[i] != splits(division)[j]
    }
    assert {(pair.i, pair.j) for pair in division.leaks if pair.kind == "place"} == brute
    assert brute


def test_kept_images_stay_where_they_are_and_new_ones_join_them():
    first = divide(line(300), [1] * 300, Rules()).records
    later = [frame(k, 2.0 * k + 1.0, session="later") for k in range(300)]
    division = divide([*first, *later], [1] * 600, Rules(seed=5, keep=True))
    for before, after in zip(first, division.records, strict=False):
        if before.split != GAP:
            assert after.split in (before.split, GAP)
    assert [r for r, now in zip(first, division.records, strict=False) if r.split == "test" != now.split] == []
    assert division.leaks == []
    torn = [msgspec.structs.replace(r, split="train" if k % 2 else "test") for k, r in enumerate(line(10))]
    assert divide([*torn, *line(300, session="far")], [1] * 310, Rules(keep=True, force=True)).leaks


def test_too_few_blocks_and_unknown_sites_are_refused_with_what_to_do():
    with pytest.raises(SplitRefused, match="--block"):
        divide(line(10), [1] * 10, Rules())
    with pytest.raises(SplitRefused, match=r"no image is of site 'moor'; there are wood"):
        divide(line(10), [1] * 10, Rules(test_sites=["moor"]))
