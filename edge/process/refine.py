"""A processed session, refined: the graph in place of the fusion, then grounding and products again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from edge import __version__
from edge.config import Config
from edge.errors import EdgeError, FormatError
from edge.process.checkpoint import Checkpoint, alone, fingerprint, key_of
from edge.process.estimators import Estimators, estimators
from edge.process.moving_stage import MOVED, find_moved
from edge.process.places import Places
from edge.process.process import ANTENNA, Task, ground, hand_out, process
from edge.process.product_facts import PRODUCTS_JSON, ProductFacts, read_facts
from edge.process.watch import Watch
from edge.validation.files import recording_files
from pipeline.refinement.constraints import Constraints, read_constraints
from pipeline.refinement.errors import RefinementError

if TYPE_CHECKING:
    from edge.process.refinement_stage import Given

FOLDER = "refined"
"""In the folder of the products."""
CONSTRAINTS = "constraints.toml"
"""The analyst's, in that folder; read where it is there and no other is named."""
_FORMAT = 3


@dataclass(frozen=True, slots=True)
class Refined:
    """redone: the stages that had to be done in this run, those of `process` among them."""

    folder: Path
    facts: ProductFacts
    redone: tuple[str, ...]


def refine(
    task: Task,
    config: Config,
    constraints: Path | None = None,
    watch: Watch | None = None,
    load: Callable[[], Estimators] = estimators,
) -> Refined:
    """Process what is not processed yet, then refine. EdgeError, FormatError for constraints that cannot be used."""
    watch = watch or Watch()
    folder = task.folder / FOLDER
    asked = constraints_of(folder, constraints)
    done = process(task, config, watch, load)
    folder.mkdir(exist_ok=True)
    with alone(folder / "work"):
        ours = Checkpoint(folder / "work")
        work = Work(task, config, watch, ours, folder, ours.folder / "refinement")
        key = key_of(_FORMAT, __version__, work.first.key("fusion"), config.refinement, asked)
        redone = work.stage("refinement", key, lambda _: _solve(work, asked))
        redone += work.rest(key)
    return Refined(folder, read_facts(folder), (*done.redone, *redone))


def _solve(work: Work, constraints: Constraints) -> None:
    with told(work.task.session):
        from edge.process.refinement_stage import solve, write_refined  # noqa: PLC0415 - GTSAM

        given = [work.given()]
        for found in solve(given, work.config.refinement, constraints, work.watch.advance):
            write_refined(found, given, work.output, f"mapforest {__version__}")


@dataclass(frozen=True)
class Work:
    """One session between its placement and its products. placement: the folder that has it. name: of the session where
    several are worked on in one folder."""

    task: Task
    config: Config
    watch: Watch
    checkpoint: Checkpoint
    output: Path
    placement: Path
    name: str = ""

    @property
    def first(self) -> Checkpoint:
        """Of `process`."""
        return Checkpoint(self.task.folder / "work")

    @property
    def places(self) -> Places:
        """The placement and what follows from it are ours."""
        theirs, ours = self.first.folder, self.checkpoint.folder
        moved = ours / self._named("moving") / MOVED if self.config.refinement.moving.enabled else None
        return Places(theirs / "odometry", self.placement, theirs / "detection", ours / self._named("grounding"), moved)

    def given(self) -> Given:
        """As the graph wants it."""
        from edge.process.refinement_stage import Given  # noqa: PLC0415 - GTSAM

        antenna = msgspec.json.decode((self.places.odometry / ANTENNA).read_bytes(), type=tuple[float, float, float])
        fusion = msgspec.structs.replace(self.config.fusion, antenna_m=antenna)
        prints = tuple(fingerprint(recording_files(self.task.targets)))
        return Given(self.task.session, prints, self.places.odometry, self.placement, fusion)

    def rest(self, key: str) -> list[str]:
        """Grounding and products, of a placement with this key; the stages that had to be done."""
        redone, detection = [], self.first.key("detection") if self.config.detection.model else ""
        if detection:
            detection = key_of(key, detection, self.config.grounding)
            redone += self.stage(self._named("grounding"), detection, self._grounding)
        moving = key_of(key, self.config.refinement.moving)
        if self.config.refinement.moving.enabled:
            redone += self.stage(self._named("moving"), moving, self._moving)
        last = key_of(moving, detection, self.config.products, self.task.session)
        redone += self.stage(self._named("products"), last, self._products, self.output / PRODUCTS_JSON)
        return redone

    def stage(self, name: str, key: str, run: Callable[[Path], None], *outputs: Path) -> list[str]:
        """Its name, where it had to be done."""
        done = self.checkpoint.done(name, key, outputs)
        self.watch.stage(f"{FOLDER}: {name}", done=done)
        if done:
            return []
        run(self.checkpoint.begin(name))
        self.checkpoint.finish(name, key)
        return [f"{FOLDER}/{name}"]

    def _named(self, stage: str) -> str:
        return f"{stage} {self.name}" if self.name else stage

    def _grounding(self, folder: Path) -> None:
        ground(self.task, self.config, self.places, folder, self.watch.advance)

    def _moving(self, folder: Path) -> None:
        voxel_m, config = self.config.products.voxel_m, self.config.refinement.moving
        find_moved(self.places, voxel_m, config, folder, self.watch.advance)

    def _products(self, _folder: Path) -> None:
        hand_out(self.task, self.config, self.places, self.output, self.watch.advance)


def constraints_of(folder: Path, named: Path | None) -> Constraints:
    """The analyst's: of a file, or of the one in the folder of the products. FormatError."""
    path = named or (folder / CONSTRAINTS if (folder / CONSTRAINTS).exists() else None)
    if path is None:
        return Constraints()
    try:
        return read_constraints(path)
    except RefinementError as error:
        raise FormatError(str(error)) from error


@contextmanager
def told(of: str) -> Iterator[None]:
    """What the refinement refuses, as an EdgeError."""
    try:
        yield
    except RefinementError as error:
        raise EdgeError(str(error) if str(error).startswith(of) else f"{of}: {error}") from error
