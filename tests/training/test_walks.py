from itertools import combinations

from training.demo_detector.walks import HELD_OUT, RESERVED_SEEDS, TRAINING_SEEDS, VALIDATION_SEEDS, held_out_walk


def test_no_walk_is_used_for_two_purposes():
    for one, other in combinations((RESERVED_SEEDS, TRAINING_SEEDS, VALIDATION_SEEDS), 2):
        assert not set(one) & set(other)


def test_every_scenario_is_held_out():
    assert {held_out_walk(seed).name for seed in VALIDATION_SEEDS} == set(HELD_OUT)
