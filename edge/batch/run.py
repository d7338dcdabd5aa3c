"""The batch itself: steps handed to the workers of a cluster, as the schedule has them."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import msgspec
from distributed import Client, Future, KilledWorker, as_completed

from edge import __version__
from edge.batch.plan import STAGES, Step
from edge.batch.schedule import TRIES, Outcome, Schedule
from edge.batch.work import Finished
from edge.batch.worker import Word
from edge.batch.worker import run as run_on_worker
from edge.config import Config
from edge.errors import ClusterError

KILLED = f"its worker ended, {TRIES} times: out of memory, or a fault in native code; try fewer --workers"


class BatchWatch(Protocol):
    """Who is told. The first two are called from another thread."""

    def began(self, step: Step, attempt: int) -> None: ...
    def went_on(self, step: Step, part: str, share: float) -> None: ...
    def finished(self, step: Step, finished: Finished) -> None: ...
    def failed(self, step: Step, reason: str) -> None: ...


class Batch:
    """memory: bytes that the biggest worker has; a step that may need more gets all of it."""

    def __init__(
        self,
        client: Client,
        config: Config,
        watch: BatchWatch,
        memory: float,
        task: Callable[..., Finished] = run_on_worker,
    ) -> None:
        self._client, self._config, self._watch, self._memory, self._task = client, config, watch, memory, task
        self._topic = f"mapforest-{uuid.uuid4().hex}"

    def run(self, plans: Sequence[Sequence[Step]]) -> list[Outcome]:
        """All sessions; an outcome each, in order. ClusterError when the scheduler is lost."""
        schedule = Schedule(plans)
        self._client.subscribe_topic(self._topic, lambda event: self._hear(schedule, event[1]))
        biggest_first = sorted(schedule.first(), key=lambda step: -step.memory_bytes)
        steps = {self._submit(step): step for step in biggest_first}
        waiting = as_completed(list(steps), loop=self._client.loop)
        for future in waiting:
            following = self._ended(schedule, steps.pop(future), future)
            future.release()  # what a worker holds of it would be made again when that dies
            if following is not None:
                begun = self._submit(following)
                steps[begun] = following
                waiting.add(begun)
        return schedule.outcomes()

    def _submit(self, step: Step) -> Future:
        return self._client.submit(
            self._task,
            step,
            self._config,
            __version__,
            self._topic,
            key=f"{step.stage}-{step.name}-{uuid.uuid4().hex[:8]}",
            pure=False,
            resources={"memory": min(step.memory_bytes, self._memory)},
            priority=STAGES.index(step.stage),  # sessions that have begun are finished first
        )

    def _ended(self, schedule: Schedule, step: Step, future: Future) -> Step | None:
        """What follows."""
        if future.status == "finished":
            finished: Finished = future.result()
            self._watch.finished(step, finished)
            return schedule.done(step, finished)
        if future.status != "error":
            raise ClusterError("the scheduler is gone; what is finished is kept: start it and this command again")
        error = future.exception()
        if isinstance(error, KilledWorker) and (again := schedule.died(step)) is not None:
            return again
        reason = KILLED if isinstance(error, KilledWorker) else _words(error)
        self._watch.failed(step, reason)
        return schedule.failed(step, reason)

    def _hear(self, schedule: Schedule, said: Any) -> None:
        word = msgspec.convert(said, Word)
        step = schedule.current(word.session, word.stage)
        if step is None:
            return
        if word.begun:
            self._watch.began(step, schedule.began(step))
        else:
            self._watch.went_on(step, word.part, word.share)


def _words(error: BaseException) -> str:
    """Ours say it all; of others the kind as well."""
    ours = type(error).__module__.partition(".")[0] in {"drivers", "edge", "pipeline"}
    return str(error) if ours else f"{type(error).__name__}: {error}"
