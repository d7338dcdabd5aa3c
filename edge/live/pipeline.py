"""The live pipeline's loop: from the bus through the estimators and back."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from drivers.messages import GnssFix
from edge.bus.client import BusClient
from edge.bus.envelope import Envelope
from edge.bus.results import Result
from edge.config import Config
from edge.control.messages import Detecting, Location
from edge.live.governor import Governor
from edge.live.intake import LiveIntake
from edge.live.poses import gnss_pose, odometry_pose, transforms
from edge.process.estimators import Estimators, estimators, fusion_config, odometry_config
from edge.recording.calibration import Calibration, load_calibration
from edge.replay.geometry import find_geometry
from edge.replay.pairing import Pairing, Sweep
from edge.ros.frames import BASE_LINK, LIDAR
from pipeline.detections import FrameDetections
from pipeline.estimates import GlobalPose, OdometryEstimate
from pipeline.odometry.warm import warm_up

if TYPE_CHECKING:
    from edge.live.detection import LiveDetection
    from edge.live.grounding import LiveGrounding

log = logging.getLogger(__name__)

WAIT_S = 0.1
TELL_S = 0.5
LOST_S = 2.0
"""Without a pose for so long, the operator is told."""


class Bus(Protocol):
    """`BusClient`, as far as it is used here."""

    unsent: int

    def receive(self, timeout_s: float) -> Iterator[Envelope]: ...
    def send(self, result: Result) -> None: ...


class Eye(Protocol):
    """`LiveDetection`, as far as it is used here."""

    @property
    def state(self) -> Detecting: ...
    def found(self) -> list[FrameDetections]: ...


class LivePipeline:
    """Odometry, fusion and grounding in host time, for as long as the recorder sends. One thread."""

    def __init__(
        self,
        config: Config,
        load: Callable[[], Estimators] = estimators,
        clock: Callable[[], int] = time.monotonic_ns,
        eye: Eye | None = None,
    ) -> None:
        """eye: the detector beside it, where there is one."""
        calibration = load_calibration(config.calibration)
        transforms_ = calibration.transforms
        geometry = find_geometry(transforms_, transforms_, BASE_LINK, LIDAR, livox=True)
        built = load()
        self._odometry = built.odometry(odometry_config(config, geometry))
        self._fusion = built.fusion(fusion_config(config, geometry))
        self._intake = LiveIntake(config.topics)
        self._clock = clock
        self._eye = eye
        self._grounding = _grounding(config, calibration) if eye is not None else None
        self._pairing = Pairing()
        self._governor = Governor()
        self._estimate: OdometryEstimate | None = None
        self._pose: GlobalPose | None = None
        self._estimated_ns = 0
        self._told_ns = 0

    @property
    def topics(self) -> Sequence[str]:
        """To subscribe to."""
        return self._intake.wanted

    def run(self, bus: Bus, stop: threading.Event) -> None:
        """Until `stop` is set."""
        while not stop.is_set():
            self.step(bus)

    def step(self, bus: Bus) -> None:
        """What is there, at most one sweep of work, and a word for the operator now and then."""
        for envelope in bus.receive(0.0 if self._governor.waiting else WAIT_S):
            self._take(envelope)
        sweep = self._governor.next()
        if sweep is not None:
            self._work(sweep, bus)
        if self._eye is not None and self._grounding is not None:
            for found in self._eye.found():
                self._grounding.see(found)
        now_ns = self._clock()
        if now_ns - self._told_ns > TELL_S * 1e9:
            self._told_ns = now_ns
            bus.send(self.location(now_ns))
            if self._eye is not None and self._grounding is not None:
                bus.send(self._eye.state)
                bus.send(self._grounding.mapped(self._estimate))

    def location(self, now_ns: int) -> Location:
        """For the operator."""
        estimate, pose, governor = self._estimate, self._pose, self._governor
        if estimate is None:
            note, nowhere = self._odometry.note, (0.0, 0.0, 0.0)
            return Location("starting", 0.0, 0.0, 0.0, nowhere, False, governor.dropped, governor.share, 0.0, note)
        age_s = max(0.0, (now_ns - self._estimated_ns) / 1e9)
        covariance = pose.covariance if pose is not None else estimate.covariance
        x, y, z = (pose.position_enu_m if pose is not None else estimate.position_m).tolist()
        state = "lost" if age_s > LOST_S else "degenerate" if estimate.degenerate else "tracking"
        return Location(
            state=state,
            distance_m=estimate.travelled_m,
            speed_m_s=float(np.linalg.norm(estimate.velocity_m_s)),
            sigma_m=float(np.sqrt(max(covariance[0, 0] + covariance[1, 1], 0.0))),
            position_m=(x, y, z),
            georeferenced=pose is not None,
            dropped=governor.dropped,
            thinned=governor.share,
            age_s=age_s,
            note=self._odometry.note or estimate.note or self._fusion.note,
        )

    def _take(self, envelope: Envelope) -> None:
        message = self._intake.decode(envelope)
        if isinstance(message, GnssFix):
            self._fusion.add_fix(message)
        elif message is not None:
            for sweep in self._pairing.add(message):
                self._governor.add(sweep)

    def _work(self, sweep: Sweep, bus: Bus) -> None:
        began_ns = self._clock()
        for tracked in self._odometry.process(sweep):
            self._tell(tracked.estimate, bus)
            if self._grounding is not None:
                self._grounding.track(tracked)
        self._governor.took((self._clock() - began_ns) / 1e9)

    def _tell(self, estimate: OdometryEstimate, bus: Bus) -> None:
        self._fusion.add_odometry(estimate)
        now_ns = self._estimated_ns = self._clock()
        self._estimate, self._pose = estimate, self._fusion.global_pose(estimate)
        bus.send(odometry_pose(estimate, now_ns))
        bus.send(transforms(estimate, self._fusion.state(), now_ns))
        if self._pose is not None:
            bus.send(gnss_pose(self._pose, now_ns))


def serve(config: Config, folder: Path, stop: threading.Event) -> None:
    """Run against the recorder whose sockets are in `folder`; waits for it, and for it to come back.

    The kernels are compiled first: what came meanwhile would be lost, and the start of a walk with it.
    """
    detection = _detection(config, folder)
    pipeline = LivePipeline(config, eye=detection)
    if detection is not None:
        detection.start(stop)
    log.info("loading the compiled kernels (the first time on a machine they are compiled: a minute)")
    warm_up(config.odometry)
    with BusClient(folder, pipeline.topics) as bus:
        log.info("live pipeline is up, sockets in %s", folder)
        pipeline.run(bus, stop)
        lost = ", ".join(f"{count} of {topic}" for topic, count in bus.lost.items() if count) or "none"
        log.info("live pipeline ends; messages lost on the bus: %s", lost)
    if detection is not None:
        detection.join()


def _grounding(config: Config, calibration: Calibration) -> LiveGrounding:
    from edge.live.grounding import LiveGrounding  # noqa: PLC0415 - OpenCV, as below
    from edge.replay.rig import camera_rig  # noqa: PLC0415
    from pipeline.grounding.warm import warm_up as warm_up_grounding  # noqa: PLC0415

    warm_up_grounding()
    rig = camera_rig(calibration, calibration.transforms, config.calibration)
    return LiveGrounding(rig, config.grounding)


def _detection(config: Config, folder: Path) -> LiveDetection | None:
    """None without a model."""
    if not config.detection.model:
        return None
    from edge.live.detection import LiveDetection  # noqa: PLC0415 - OpenCV and PyAV, only where they are needed

    return LiveDetection(config, partial(BusClient, folder))
