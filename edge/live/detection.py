"""The live detector's thread: it loads the model, looks until told to stop, and steps aside for the odometry."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager

import cv2

from edge.config import Config
from edge.control.messages import Detecting
from edge.detection import open_detector
from edge.errors import EdgeError
from edge.live.looker import Bus, Looker
from edge.recording.calibration import load_calibration
from pipeline.detection.errors import DetectionError
from pipeline.detections import FrameDetections

log = logging.getLogger(__name__)

NICER = 5
"""Than the odometry's thread."""
LEAVE_S = 5.0
"""An image on a slow computer takes as long."""

Connect = Callable[[Sequence[str]], AbstractContextManager[Bus]]
"""To these topics."""


class LiveDetection:
    """A thread of its own, with its own line to the recorder: decoding and inference let the others run."""

    def __init__(self, config: Config, connect: Connect) -> None:
        self._config = config
        self._connect = connect
        self._looker: Looker | None = None
        self._loading = Detecting("starting", config.detection.model, note="loading the model")
        self._thread: threading.Thread | None = None

    @property
    def state(self) -> Detecting:
        """For the operator. Any thread."""
        looker = self._looker
        return looker.state if looker is not None else self._loading

    def found(self) -> list[FrameDetections]:
        """Images that were looked at since the last call. Any one thread."""
        looker = self._looker
        taken = []
        while looker is not None and looker.found:
            taken.append(looker.found.popleft())
        return taken

    def start(self, stop: threading.Event) -> None:
        """Until `stop` is set."""
        self._thread = threading.Thread(target=self._run, args=(stop,), name="detection", daemon=True)
        self._thread.start()

    def join(self) -> None:
        """Wait for it to end."""
        if self._thread is not None:
            self._thread.join(LEAVE_S)

    def _run(self, stop: threading.Event) -> None:
        """Thread root."""
        try:
            _step_aside()
            detector = open_detector(self._config.detection, threads=1)
            lens = load_calibration(self._config.calibration).file.intrinsics
            log.info("an image takes %.0f ms", 1e3 * detector.time_s((lens.height_px, lens.width_px), 1))
            looker = Looker(self._config.detection, detector)
            with self._connect([self._config.topics.video]) as bus:
                self._looker = looker
                while not stop.is_set():
                    looker.step(bus)
        except (DetectionError, EdgeError) as error:
            log.error("%s", error)  # noqa: TRY400 - it says what to do; where it was raised does not matter
            self._fail(str(error))
        except Exception as error:  # the thread's root: the odometry goes on
            log.exception("detection died")
            self._fail(f"ended by an error ({error!r}); see the log, and restart the pipeline to have it back")

    def _fail(self, note: str) -> None:
        self._looker, self._loading = None, Detecting("failed", self._config.detection.model, note=note)


def _step_aside() -> None:
    """Linux gives each thread a priority of its own; those that onnxruntime starts from here have this one's."""
    cv2.setNumThreads(1)
    thread = threading.get_native_id()
    try:
        os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + NICER)
    except OSError as error:
        log.warning("the detector runs at the odometry's priority: %s", error.strerror)
