"""When the watchdog is fed."""

from edge.service.progress import RECEIVER_STALL_S, Progress, Receiver, writer_stall_s

AFTER_NS = int((RECEIVER_STALL_S + 1) * 1e9)


def test_a_receiver_that_claims_to_deliver_and_does_not_is_stuck() -> None:
    progress = Progress()
    assert progress.stuck_receivers([Receiver("a", True, 5)], 0) == ([], False)
    assert progress.stuck_receivers([Receiver("a", True, 5)], AFTER_NS) == (["a"], True)
    assert progress.stuck_receivers([Receiver("a", True, 6)], AFTER_NS) == ([], False)


def test_one_of_two_stuck_is_not_all() -> None:
    progress = Progress()
    progress.stuck_receivers([Receiver("a", True, 5), Receiver("b", True, 5)], 0)
    assert progress.stuck_receivers([Receiver("a", True, 5), Receiver("b", True, 9)], AFTER_NS) == (["a"], False)


def test_a_sensor_that_is_away_is_not_stuck_nor_when_it_has_just_come_back() -> None:
    progress = Progress()
    progress.stuck_receivers([Receiver("a", False, 5)], 0)
    assert progress.stuck_receivers([Receiver("a", False, 5)], AFTER_NS) == ([], False)
    assert progress.stuck_receivers([Receiver("a", True, 5)], AFTER_NS + 1) == ([], False)


def test_a_stall_of_the_writer_is_measured_from_its_last_progress() -> None:
    assert writer_stall_s(1_000_000_000, 3_500_000_000) == 2.5
    assert writer_stall_s(5, 0) == 0.0
