from training.demo_detector.score import Tally


def test_recall_counts_the_trees_of_a_range():
    tally = Tally(found_m=[3.0, 12.0], missed_m=[4.0])
    assert (tally.recall(), tally.recall(0.0, 5.0), tally.recall(5.0, 15.0)) == (2 / 3, 0.5, 1.0)
