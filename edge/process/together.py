"""Several sessions of one site, refined together: the products of each on one `map`, and one map of all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from edge import __version__
from edge.config import Config
from edge.errors import EdgeError
from edge.process import fusion_stage, odometry_stage
from edge.process.checkpoint import Checkpoint, alone, key_of
from edge.process.estimators import Estimators, estimators
from edge.process.moving_stage import read_moved
from edge.process.process import Task, process
from edge.process.product_facts import read_facts, whole
from edge.process.refine import FOLDER, Refined, Work, constraints_of, told
from edge.process.watch import Watch
from pipeline.products.covariance import horizontal_sigma_m
from pipeline.products.findings import Findings
from pipeline.products.laz import MapSource, write_laz
from pipeline.products.track import read_track
from pipeline.refinement.constraints import Constraints

MAP, GROUPS = "map.laz", "together.json"
_FORMAT = 2


class Group(msgspec.Struct, frozen=True):
    """Sessions that share one `map` or `local`, and the folder with the graph's page, list and facts."""

    sessions: tuple[str, ...]
    folder: str


@dataclass(frozen=True, slots=True)
class Together:
    """groups: the largest first. sessions: each one's products, as they were named. redone: in all of it."""

    folder: Path
    groups: tuple[Group, ...]
    sessions: tuple[Refined, ...]
    redone: tuple[str, ...]


def default_output(tasks: Sequence[Task]) -> Path:
    """Beside the first session."""
    first = tasks[0]
    return first.targets[0].absolute().parent / f"{first.session}_and_{len(tasks) - 1}_more_{FOLDER}"


def refine_together(
    tasks: Sequence[Task],
    config: Config,
    output: Path | None = None,
    constraints: Path | None = None,
    *,
    watch: Watch | None = None,
    load: Callable[[], Estimators] = estimators,
) -> Together:
    """Process what is not processed yet, then refine. EdgeError, FormatError for constraints that cannot be used."""
    watch = watch or Watch()
    _check_names(tasks)
    folder = output or default_output(tasks)
    asked = constraints_of(folder, constraints)
    redone = [f"{task.session}: {name}" for task in tasks for name in process(task, config, watch, load).redone]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise EdgeError(f"{folder}: cannot be made ({error.strerror}); give another place with --out") from error
    with alone(folder / "work"):
        site = _Site(tasks, config, asked, watch, Checkpoint(folder / "work"), folder)
        redone += site.run()
        done = tuple(Refined(work.output, read_facts(work.output), tuple(redone)) for work in site.works)
        return Together(folder, tuple(site.groups()), done, tuple(redone))


def _check_names(tasks: Sequence[Task]) -> None:
    name, count = Counter(task.session for task in tasks).most_common(1)[0]
    if count > 1:
        raise EdgeError(f"{count} sessions are called {name}: rename one, its products and constraints go by that name")


@dataclass(frozen=True)
class _Site:
    tasks: Sequence[Task]
    config: Config
    constraints: Constraints
    watch: Watch
    checkpoint: Checkpoint
    output: Path
    works: list[Work] = field(init=False)

    def __post_init__(self) -> None:
        placements = self.checkpoint.folder / "refinement"
        works = []
        for task in self.tasks:
            name, place = task.session, self.output / task.session
            works.append(Work(task, self.config, self.watch, self.checkpoint, place, placements / name, name))
        object.__setattr__(self, "works", works)

    def run(self) -> list[str]:
        """What had to be done."""
        fused = [(work.name, work.first.key("fusion")) for work in self.works]
        key = key_of(_FORMAT, __version__, fused, self.config.refinement, self.constraints)
        redone = self.works[0].stage("refinement", key, self._solve)
        for work in self.works:
            redone += work.rest(key_of(key, work.name))
        last = key_of(key, [work.first.key("detection") for work in self.works], self.config.products)
        maps = [self.output / group.folder / MAP for group in self._shared()]
        redone += self.works[0].stage("map", last, lambda _: self._maps(), *maps)
        return redone

    def groups(self) -> list[Group]:
        """As the graph found them."""
        return msgspec.json.decode((self.output / GROUPS).read_bytes(), type=list[Group])

    def _solve(self, folder: Path) -> None:
        with told("sessions together"):
            from edge.process.refinement_stage import solve, write_refined  # noqa: PLC0415 - GTSAM

            self._clear()
            for work in self.works:
                (folder / work.name).mkdir()
                work.output.mkdir(exist_ok=True)
            given = [work.given() for work in self.works]
            found = solve(given, self.config.refinement, self.constraints, self.watch.advance)
            groups = [Group(tuple(one.problem.names), _folder(k, one.problem.names)) for k, one in enumerate(found)]
            for one, group in zip(found, groups, strict=True):
                (self.output / group.folder).mkdir(exist_ok=True)
                write_refined(one, given, self.output / group.folder, f"mapforest {__version__}")
            (self.output / GROUPS).write_bytes(msgspec.json.encode(groups))

    def _clear(self) -> None:
        """What an earlier run left of groups that may be others now."""
        from edge.process.refinement_stage import MADE  # noqa: PLC0415 - GTSAM

        for group in self.groups() if (self.output / GROUPS).exists() else ():
            for name in (*MADE, *((MAP,) if len(group.sessions) > 1 else ())):
                (self.output / group.folder / name).unlink(missing_ok=True)

    def _shared(self) -> list[Group]:
        """Those with one map of several sessions."""
        return [group for group in self.groups() if len(group.sessions) > 1]

    def _maps(self) -> None:
        for group in self._shared():
            sources = [self._source(work) for work in self.works if work.name in group.sessions]
            with whole(self.output / group.folder / MAP) as path:
                write_laz(path, sources, self.watch.advance)

    def _source(self, work: Work) -> MapSource:
        odometry = work.places.odometry
        placement = fusion_stage.read_placement(work.placement / fusion_stage.PLACEMENT)
        assert placement is not None
        track, facts = read_track(odometry / odometry_stage.TRACK), read_facts(work.output)
        findings = self._findings(work)
        return MapSource(
            odometry / odometry_stage.TILES,
            self.config.products.voxel_m,
            track["stamp_ns"].astype("int64"),
            horizontal_sigma_m(placement.covariance),
            placement,
            work.name,
            facts.georeference.heights if facts.georeference is not None else "",
            findings.evidence if findings is not None else None,
            self.works.index(work) + 1,
            read_moved(work.places.moved),
        )

    def _findings(self, work: Work) -> Findings | None:
        if not self.config.detection.model:
            return None
        from edge.process.findings import read_findings  # noqa: PLC0415

        return read_findings(work.places, self.config.grounding.probable)


def _folder(number: int, names: Sequence[str]) -> str:
    """Of a group: the first one of several has the output itself, one that is alone lies with its products."""
    if len(names) == 1:
        return names[0]
    return f"group_{number + 1}" if number else "."
