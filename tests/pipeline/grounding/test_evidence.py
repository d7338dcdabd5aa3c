import numpy as np
import pytest

from pipeline.grounding.config import EvidenceConfig
from pipeline.grounding.evidence import Evidence
from pipeline.grounding.likelihood import hit, log_odds, miss, probability

CONFIG = EvidenceConfig()


def test_evidence_is_summed_by_voxel_and_once_a_view():
    random = np.random.default_rng(6)
    evidence, expected = Evidence(0.5, 8.0), {}
    for _ in range(40):
        points = random.uniform(-20, 20, (4000, 3))
        change = random.choice([1.5, -0.5, np.nan], 4000).astype(np.float32)
        evidence.add(points, change)
        told = set()
        for key, word in zip(map(tuple, np.floor(points / 0.5).astype(int).tolist()), change.tolist(), strict=True):
            if np.isnan(word) or key in told:
                continue
            told.add(key)
            odds, seen, hits = expected.get(key, (0.0, 0, 0))
            expected[key] = (min(max(odds + word, -8.0), 8.0), seen + 1, hits + (word > 0))
    assert len(evidence) == len(expected)
    keys = list(expected)[:5000]
    heat = evidence.at((np.array(keys) + 0.5) * 0.5)
    found = np.column_stack([heat.log_odds, heat.seen, heat.hits])
    np.testing.assert_allclose(found, [expected[key] for key in keys], atol=1e-5)


def test_a_place_never_seen_is_not_a_place_without_a_target():
    evidence = Evidence(0.3, 8.0)
    evidence.add(np.zeros((1, 3)), np.array([-1.0], np.float32))
    heat = evidence.at(np.array([[0.1, 0.1, 0.1], [9.0, 9.0, 9.0]]))
    assert heat.seen.tolist() == [1, 0]
    assert heat.probability[0] < 0.5 == heat.probability[1]


def test_what_was_saved_goes_on(tmp_path):
    points = np.random.default_rng(7).uniform(-30, 30, (60_000, 3))
    evidence = Evidence(0.3, 8.0)
    evidence.add(points, np.full(len(points), 0.7, np.float32))
    evidence.save(tmp_path / "evidence.npz")
    again = Evidence.load(tmp_path / "evidence.npz")
    for one in (evidence, again):
        one.add(points, np.full(len(points), 0.7, np.float32))
    np.testing.assert_array_equal(evidence.at(points).log_odds, again.at(points).log_odds)
    assert again.at(points).seen.min() == 2


def test_voxels_are_told_with_the_last_view_that_spoke_of_them():
    evidence = Evidence(0.3, 8.0)
    evidence.add(np.array([[0.1, 0.1, 0.1], [-3.1, 0.1, 5.0]]), np.array([-1.0, 2.0], np.float32))
    evidence.add(np.array([[-3.1, 0.1, 5.0]]), np.array([1.0], np.float32))
    middles, log_odds, last = evidence.voxels()
    told = {tuple(place): said for *place, said in np.column_stack([middles.round(2), log_odds]).tolist()}
    assert told == {(0.15, 0.15, 0.15): -1.0, (-3.15, 0.15, 4.95): 3.0}
    assert sorted(last.tolist()) == [1, 2]


def test_a_tree_seen_ten_times_and_detected_once_is_no_finding():
    odds = log_odds(CONFIG.prior) + hit(0.9, 6.0, 18.0, CONFIG) + 9 * miss(6.0, 18.0, CONFIG)
    assert probability(odds) < 0.01


def test_a_tree_detected_in_most_views_is_one():
    odds = log_odds(CONFIG.prior) + 3 * hit(0.6, 6.0, 18.0, CONFIG) + 2 * miss(6.0, 18.0, CONFIG)
    assert probability(odds) > 0.9


def test_far_away_silence_says_little():
    assert miss(17.0, 18.0, CONFIG) == pytest.approx(miss(6.0, 18.0, CONFIG) / 2, rel=0.1)
    assert miss(17.0, 18.0, CONFIG) < 0.0


def test_a_box_that_may_mean_another_says_less():
    assert 0.0 < hit(0.8, 6.0, 18.0, CONFIG, 0.2) < hit(0.8, 6.0, 18.0, CONFIG)
    assert hit(0.8, 6.0, 18.0, CONFIG, 0.0) == 0.0
