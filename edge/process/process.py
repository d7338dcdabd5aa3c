"""The work on one recording: its stages, each kept when finished, each redone when what it was made from changed."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from edge import __version__
from edge.config import Config
from edge.errors import EdgeError
from edge.process.checkpoint import Checkpoint, alone, fingerprint, key_of
from edge.process.estimators import Estimators, estimators, fusion_config, odometry_config
from edge.process.fusion_stage import FusionStage
from edge.process.looked_with import remember
from edge.process.odometry_stage import OdometryFacts, OdometryStage
from edge.process.places import Places
from edge.process.product_facts import PRODUCTS_JSON, ProductFacts, read_facts
from edge.process.products_stage import ProductsStage
from edge.process.watch import Watch
from edge.replay.replay import Replay, ReplayOptions
from edge.replay.rig import camera_rig, recorded_calibration
from edge.validation.files import recording_files

if TYPE_CHECKING:  # heavy: OpenCV
    from pipeline.detection.detector import Detector

STAGES = ("odometry", "fusion", "detection", "grounding", "products")
ANTENNA = "antenna.json"
"""Where the recording says the antenna is: the fusion does not open it again."""
_FORMAT = 4
"""Of the files between the stages."""


@dataclass(frozen=True, slots=True)
class Task:
    """What is asked. targets: a session's folder or .mcap files. output: None puts products beside the recording."""

    targets: Sequence[Path]
    output: Path | None = None
    gnss: bool = True
    fresh: bool = False
    """Do everything again."""
    replay: ReplayOptions = field(default_factory=ReplayOptions)

    @property
    def folder(self) -> Path:
        """Where the products go: `products/` in a session's folder, `<name>_products/` beside a file."""
        if self.output is not None:
            return self.output
        first = self.targets[0]
        return first / "products" if first.is_dir() else first.with_name(f"{first.name.partition('.')[0]}_products")

    @property
    def session(self) -> str:
        """The recording's name."""
        first = self.targets[0].absolute()
        return first.name if first.is_dir() else first.name.partition(".")[0]


@dataclass(frozen=True, slots=True)
class Done:
    """redone: the stages that had to be done in this run."""

    folder: Path
    facts: ProductFacts
    redone: tuple[str, ...]


def process(
    task: Task, config: Config, watch: Watch | None = None, load: Callable[[], Estimators] = estimators
) -> Done:
    """Odometry, fusion; detection and grounding where a model is configured; products.

    FormatError for what cannot be used, EdgeError where nothing could be estimated, DetectionError for a wrong model.
    """
    files = recording_files(task.targets)
    work = task.folder / "work"
    with alone(_made(work)):
        return _Work(task, config, watch or Watch(), load, Checkpoint(work), fingerprint(files)).run()


@dataclass
class _Work:
    task: Task
    config: Config
    watch: Watch
    load: Callable[[], Estimators]
    checkpoint: Checkpoint
    prints: list[tuple[str, int, str]]
    redone: list[str] = field(default_factory=list)
    detector: Detector | None = None
    """While its stage is still to be done."""

    def run(self) -> Done:
        if self.task.fresh:
            for stage in STAGES:
                self.checkpoint.begin(stage)
        odometry, fusion = self._keys()
        detection = self._detection_key()
        if detection and not self.checkpoint.done("detection", detection):
            self.detector = self.open_detector()  # first: a wrong model is told before an hour of odometry
        self._stage("odometry", odometry, self._odometry)
        self._stage("fusion", fusion, self._fusion)
        if detection:
            self._stage("detection", detection, self._detection)
            detection = key_of(fusion, detection, self.config.grounding)
            self._stage("grounding", detection, self._grounding)
        last = key_of(fusion, detection, self.config.products, self.task.session)
        self._stage("products", last, self._products, [self.task.folder / PRODUCTS_JSON])
        return Done(self.task.folder, read_facts(self.task.folder), tuple(self.redone))

    @property
    def places(self) -> Places:
        """All under the work folder."""
        return Places.of(self.checkpoint.folder)

    def open_detector(self) -> Detector:
        """As configured. DetectionError."""
        from edge.detection import open_detector  # noqa: PLC0415 - OpenCV, and only where a model is configured

        return open_detector(self.config.detection)

    def _keys(self) -> tuple[str, str]:
        options = self.task.replay
        pose = None if options.lidar_pose is None else options.lidar_pose.tolist()
        wanted = options.wanted
        asked = [wanted.lidar, wanted.imu, wanted.fix, options.time_field, pose, self.task.gnss]
        tiles = (self.config.products.voxel_m, self.config.products.tile_m)
        settings = [self.config.odometry, tiles, self.config.topics, self.config.calibration]
        first = key_of(_FORMAT, __version__, self.prints, asked, settings)
        return first, key_of(first, self.config.fusion)

    def _detection_key(self) -> str:
        """Empty without a model."""
        settings = self.config.detection
        if not settings.model:
            return ""
        from edge.detection import model_path  # noqa: PLC0415
        from pipeline.detection.runtime import sha256  # noqa: PLC0415

        said = [sha256(model_path(settings.model)), settings.confidence, settings.iou, settings.rate_hz]
        return key_of(_FORMAT, __version__, self.prints, self.config.topics, said)

    def _stage(self, name: str, key: str, run: Callable[[Path], object], outputs: Sequence[Path] = ()) -> None:
        done = self.checkpoint.done(name, key, outputs)
        self.watch.stage(name, done=done)
        if not done:
            run(self.checkpoint.begin(name))
            self.checkpoint.finish(name, key)
            self.redone.append(name)

    def _odometry(self, folder: Path) -> None:
        replay = Replay(self.task.targets, self.config, self.task.replay)
        built = self.load().odometry(odometry_config(self.config, replay.geometry))
        (folder / ANTENNA).write_bytes(msgspec.json.encode(fusion_config(self.config, replay.geometry).antenna_m))
        facts = OdometryStage(replay, built, self.config.products, self.task.gnss).run(folder, self.watch.advance)
        if not facts.estimates:
            raise EdgeError(_nothing(self.task.session, facts))

    def _fusion(self, folder: Path) -> None:
        odometry = self.checkpoint.folder / "odometry"
        antenna = msgspec.json.decode((odometry / ANTENNA).read_bytes(), type=tuple[float, float, float])
        config = msgspec.structs.replace(self.config.fusion, antenna_m=antenna)
        FusionStage(odometry, self.load().smooth, config).run(folder, self.watch.advance)

    def _detection(self, folder: Path) -> None:
        from edge.process.detection_stage import DetectionStage  # noqa: PLC0415

        assert self.detector is not None
        DetectionStage(self.task.targets, self.config, self.detector).run(folder, self.watch.advance)
        remember(self.checkpoint.folder, self.config.detection.model)

    def _grounding(self, folder: Path) -> None:
        ground(self.task, self.config, self.places, folder, self.watch.advance)

    def _products(self, _folder: Path) -> None:
        hand_out(self.task, self.config, self.places, self.task.folder, self.watch.advance)


def ground(task: Task, config: Config, places: Places, folder: Path, advance: Callable[[float], None]) -> None:
    """Put what the images showed on the map; into `folder`, which `places` has for it."""
    from edge.process.grounding_stage import GroundingStage  # noqa: PLC0415
    from edge.process.tree_pictures import write_pictures  # noqa: PLC0415
    from edge.process.trees_file import PICTURES  # noqa: PLC0415

    replay = Replay(task.targets, config, task.replay)
    calibration = recorded_calibration(replay.facts, config.calibration)
    rig = camera_rig(calibration, replay.static_transforms, config.calibration)
    stage = GroundingStage(places, rig, config.products.tile_m, config.grounding)
    trees = stage.run(folder, advance)
    probable = [tree for tree in trees if tree.probability >= config.grounding.probable]
    write_pictures(folder / PICTURES, probable, task.targets, config)


def hand_out(task: Task, config: Config, places: Places, output: Path, advance: Callable[[float], None]) -> None:
    """Make the products from what the stages left."""
    findings = None
    if config.detection.model:
        from edge.process.findings import read_findings  # noqa: PLC0415

        findings = read_findings(places, config.grounding.probable)
    software = f"mapforest {__version__}"
    ProductsStage(places, output, config.products, task.session, software, findings).run(advance)


def clean(task: Task) -> None:
    """Take the files between the stages away: a later run starts from the beginning."""
    shutil.rmtree(task.folder / "work", ignore_errors=True)


def _nothing(session: str, facts: OdometryFacts) -> str:
    why = "; ".join(f"{note} ({count} times)" for note, count in facts.refusals.items()) or "there were no sweeps"
    return f"{session}: no pose could be estimated from {facts.sweeps} sweeps: {why}"


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise EdgeError(f"{folder}: cannot be made ({error.strerror}); give another place with --output") from error
    return folder
