from drivers.messages import ImuSample
from pipeline.odometry.time_gate import BELIEVED_NS, LEAP_NS, TimeGate

S = 1_000_000_000


def at(stamp_ns):
    return ImuSample(stamp_ns, stamp_ns, (0.0, 0.0, 0.0), (0.0, 0.0, 9.8))


def passed(gate, stamps):
    return [one.stamp_ns for stamp in stamps for one in gate.admit(at(stamp))]


def test_what_goes_on_goes_through_whatever_its_order():
    stamps = [0, 2 * S, S, 3 * S, 3 * S + LEAP_NS]
    gate = TimeGate()
    assert passed(gate, stamps) == stamps
    assert gate.refused == 0


def test_a_stray_stamp_is_left_out_and_told_once():
    gate = TimeGate()
    assert passed(gate, [S, 3600 * S, 2 * S, -900 * S, 3 * S]) == [S, 2 * S, 3 * S]
    assert gate.refused == 2
    assert gate.newly_refused() == 2
    assert gate.newly_refused() == 0


def test_strays_that_disagree_are_never_believed():
    gate = TimeGate()
    assert passed(gate, [S, *(k * 100 * S for k in range(1, 50))]) == [S]
    assert gate.refused == 48


def test_a_second_elsewhere_is_left_out():
    gate = TimeGate()
    elsewhere = range(1000 * S, 1001 * S, S // 10)
    assert passed(gate, [S, *elsewhere, 2 * S]) == [S, 2 * S]


def test_stamps_that_go_on_elsewhere_are_the_time_and_none_is_lost():
    for begin in (1000 * S, -1000 * S):
        gate, leaps = TimeGate(), []
        elsewhere = list(range(begin, begin + 2 * BELIEVED_NS, S // 10))
        through = []
        for stamp in [S, *elsewhere]:
            through += [one.stamp_ns for one in gate.admit(at(stamp))]
            leaps.append(gate.leapt_ns)
        assert through == [S, *elsewhere]
        assert [leap for leap in leaps if leap] == [begin + BELIEVED_NS - S]
        assert gate.refused == 0
