"""A processed session, refined: the graph in place of the fusion, then grounding and products again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec

from edge import __version__
from edge.config import Config
from edge.errors import EdgeError, FormatError
from edge.process.checkpoint import Checkpoint, alone, fingerprint, key_of
from edge.process.estimators import Estimators, estimators
from edge.process.places import Places
from edge.process.process import ANTENNA, Task, ground, hand_out, process
from edge.process.product_facts import PRODUCTS_JSON, ProductFacts, read_facts
from edge.process.watch import Watch
from edge.validation.files import recording_files
from pipeline.refinement.constraints import Constraints, read_constraints
from pipeline.refinement.errors import RefinementError

FOLDER = "refined"
"""In the folder of the products."""
CONSTRAINTS = "constraints.toml"
"""The analyst's, in that folder; read where it is there and no other is named."""
_FORMAT = 1


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
    given = constraints or (folder / CONSTRAINTS if (folder / CONSTRAINTS).exists() else None)
    asked = _constraints(given)
    done = process(task, config, watch, load)
    first = Checkpoint(task.folder / "work")
    folder.mkdir(exist_ok=True)
    with alone(folder / "work"):
        work = _Work(task, config, asked, watch, first, Checkpoint(folder / "work"), folder)
        redone = work.run()
    return Refined(folder, read_facts(folder), (*done.redone, *redone))


@dataclass(frozen=True)
class _Work:
    task: Task
    config: Config
    constraints: Constraints
    watch: Watch
    first: Checkpoint
    """Of `process`."""
    checkpoint: Checkpoint
    output: Path

    @property
    def places(self) -> Places:
        """The placement and what follows from it are ours."""
        theirs, ours = self.first.folder, self.checkpoint.folder
        return Places(theirs / "odometry", ours / "refinement", theirs / "detection", ours / "grounding")

    def run(self) -> list[str]:
        settings, redone = self.config.refinement, []
        key = key_of(_FORMAT, __version__, self.first.key("fusion"), settings, self.constraints)
        redone += self._stage("refinement", key, self._refinement)
        detection = self.first.key("detection") if self.config.detection.model else ""
        if detection:
            detection = key_of(key, detection, self.config.grounding)
            redone += self._stage("grounding", detection, self._grounding)
        last = key_of(key, detection, self.config.products, self.task.session)
        redone += self._stage("products", last, self._products, self.output / PRODUCTS_JSON)
        return [f"{FOLDER}/{name}" for name in redone]

    def _stage(self, name: str, key: str, run: Callable[[Path], None], *outputs: Path) -> list[str]:
        done = self.checkpoint.done(name, key, outputs)
        self.watch.stage(f"{FOLDER}: {name}", done=done)
        if done:
            return []
        run(self.checkpoint.begin(name))
        self.checkpoint.finish(name, key)
        return [name]

    def _refinement(self, folder: Path) -> None:
        try:
            from edge.process.refinement_stage import RefinementFacts, RefinementStage  # noqa: PLC0415 - GTSAM

            antenna = msgspec.json.decode(
                (self.places.odometry / ANTENNA).read_bytes(), type=tuple[float, float, float]
            )
            fusion = msgspec.structs.replace(self.config.fusion, antenna_m=antenna)
            prints = tuple(fingerprint(recording_files(self.task.targets)))
            facts = RefinementFacts(f"mapforest {__version__}", prints, self.config.refinement, self.constraints)
            stage = RefinementStage(self.places.odometry, self.output, fusion, self.config.refinement, self.constraints)
            stage.run(folder, facts, self.watch.advance)
        except RefinementError as error:
            raise EdgeError(f"{self.task.session}: {error}") from error

    def _grounding(self, folder: Path) -> None:
        ground(self.task, self.config, self.places, folder, self.watch.advance)

    def _products(self, _folder: Path) -> None:
        hand_out(self.task, self.config, self.places, self.output, self.watch.advance)


def _constraints(path: Path | None) -> Constraints:
    if path is None:
        return Constraints()
    try:
        return read_constraints(path)
    except RefinementError as error:
        raise FormatError(str(error)) from error
