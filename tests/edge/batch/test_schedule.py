"""Steps follow each other, and one session's failure is its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from edge.batch.plan import MIB, Step, most_memory, plan, worker_count
from edge.batch.schedule import TRIES, Schedule
from edge.batch.work import Finished

DONE = Finished("out", ("odometry",), 1.0)


def plans(*names: str, refine: bool = True) -> list[tuple[Step, ...]]:
    return [plan(Path(name), refine=refine) for name in names]


def test_a_session_goes_from_stage_to_stage_and_reports_on_the_refined_products():
    schedule = Schedule(plans("a"))
    (step,) = schedule.first()
    seen = []
    while step is not None:
        seen.append((step.stage, step.refined))
        step = schedule.done(step, DONE)
    assert seen == [("process", False), ("refine", False), ("report", True)]
    assert list(schedule.outcomes()[0].done) == ["process", "refine", "report"]


def test_a_failed_session_ends_there_and_a_failed_refinement_is_reported_without():
    schedule = Schedule(plans("a", "b"))
    a, b = schedule.first()
    assert schedule.failed(a, "no sweeps") is None
    refine = schedule.done(b, DONE)
    report = schedule.failed(refine, "no fixes")
    assert (report.stage, report.refined) == ("report", False)
    assert schedule.done(report, DONE) is None
    first, second = schedule.outcomes()
    assert (first.failed, first.done) == ({"process": "no sweeps"}, {})
    assert (second.failed, list(second.done)) == ({"refine": "no fixes"}, ["process", "report"])


def test_who_ends_workers_is_given_up_and_who_only_waited_there_is_not():
    schedule = Schedule(plans("killer", "innocent", "other"))
    killer, innocent, _ = schedule.first()
    assert [schedule.began(killer) for _ in range(TRIES)] == [1, 2, 3]
    assert schedule.died(killer) is None
    schedule.began(innocent)
    assert schedule.died(innocent) is innocent
    assert schedule.failed(killer, "its worker ended") is None
    assert schedule.current("innocent", "process") is innocent
    assert schedule.current("innocent", "refine") is None
    assert schedule.current("nobody", "process") is None


def test_a_worker_that_dies_before_it_can_say_whose_fault_it_was_is_not_tried_for_ever():
    schedule = Schedule(plans("a", "b"))
    step, _ = schedule.first()
    assert [schedule.died(step) for _ in range(3)] == [step, step, None]


def test_memory_grows_with_the_recording_and_decides_how_many_workers_there_are(tmp_path):
    small, big = tmp_path / "small", tmp_path / "big"
    for folder, size in ((small, 1000), (big, 500_000_000)):
        folder.mkdir()
        with (folder / "walk_0.mcap").open("wb") as file:
            file.truncate(size)
    steps = [plan(folder, refine=True) for folder in (small, big)]
    needs = [[step.memory_bytes for step in session] for session in steps]
    assert all(much > little for much, little in zip(needs[1], needs[0], strict=True))
    assert most_memory(steps) == max(needs[1])
    assert [step.stage for step in plan(small, refine=False)] == ["process", "report"]


@pytest.mark.parametrize(
    ("asked", "sessions", "there_mib", "workers"),
    [(8, 100, 16_000, 8), (8, 3, 16_000, 3), (8, 100, 4500, 4), (8, 100, 500, 1)],
)
def test_workers_are_as_many_as_asked_as_there_is_work_and_as_memory_has_room_for(asked, sessions, there_mib, workers):
    assert worker_count(asked, sessions, 1000 * MIB, there_mib * MIB) == workers
