"""What the operator asks of the recorder: start, stop, mark, validate."""

from __future__ import annotations

import logging
import platform
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from edge import __version__
from edge.config import Config, to_toml
from edge.control.messages import Reply, Request
from edge.errors import ControlError, EdgeError
from edge.paths import recordings_folder
from edge.recording.account import RecordingStatus, SessionAbout, SessionResult
from edge.recording.anchor import Anchor
from edge.recording.messages import Mark, Recordable
from edge.recording.session import SessionRecorder, session_folder
from edge.service.host_clock import Discipline, discipline
from edge.service.intake import Intake
from edge.service.judge import Judge
from edge.service.supervisor import Supervisor

log = logging.getLogger(__name__)

SOFTWARE = f"mapforest {__version__}"
REPAIR_HEAD_START_S = 2.0
"""The repair lists the folders it will touch in its first moment. A start this soon after boot waits for it, no
longer: a new session must not be listed, and an operator not kept waiting while a large file is repaired."""


class Session(Protocol):
    """`SessionRecorder`, as far as it is used here."""

    def start(self) -> None: ...
    def offer(self, message: Recordable) -> None: ...
    def status(self) -> RecordingStatus: ...
    def stop(self, reason: str) -> SessionResult: ...


OpenSession = Callable[[Path, SessionAbout, Config, Anchor], Session]


class Recorder:
    """Holds the session being recorded. Commands come from the command thread and the service's own."""

    def __init__(
        self,
        config: Config,
        intake: Intake,
        supervisor: Supervisor,
        judge: Judge,
        *,
        open_session: OpenSession = SessionRecorder,
        system_clock: Callable[[], Discipline] = discipline,
    ) -> None:
        self.state = "idle"
        self.mission = ""
        self.problem = ""
        """What went wrong with the last session; empty again with the next start."""
        self.repaired = threading.Event()
        """Set when the leftovers of a power cut have been put in order."""
        self._config = config
        self._config_toml = to_toml(config)
        self._intake = intake
        self._supervisor = supervisor
        self._judge = judge
        self._open_session = open_session
        self._system_clock = system_clock
        self._began_ns = time.monotonic_ns()
        self._lock = threading.Lock()
        self._session: Session | None = None
        self._folder: Path | None = None

    @property
    def session_status(self) -> RecordingStatus | None:
        """Of the session being recorded or finished, None when idle. Any thread."""
        session = self._session
        return session.status() if session is not None else None

    def handle(self, request: Request, receive_ns: int) -> Reply:
        """Carry out start, stop, mark or validate. EdgeError when it cannot be done."""
        with self._lock:
            if request.command == "start":
                self._start(request)
            elif request.command == "stop":
                self._check_session(request.session)
                self._stop("asked to stop")
            elif request.command == "mark":
                self._mark(request.text, receive_ns)
            elif request.command == "validate":
                self._validate(request.session)
            folder = self._folder
        return Reply(
            request.id,
            ok=True,
            session=folder.name if folder else "",
            folder=str(folder or ""),
            software=SOFTWARE,
        )

    def stop(self, reason: str) -> None:
        """End the session, if there is one. Returns when it is finished on the disk."""
        with self._lock:
            self._stop(reason)

    def tell(self, problem: str) -> None:
        """Show the operator what happened before this service came up, until the next start."""
        # Without the lock: a start that waits for the repair holds it, and clears the problem anyway.
        if self._session is None:
            self.problem = problem

    def _start(self, request: Request) -> None:
        if self._session is not None:
            return
        self.repaired.wait(max(0.0, REPAIR_HEAD_START_S - (time.monotonic_ns() - self._began_ns) / 1e9))
        mission = request.mission or self._config.mission.name
        anchor = Anchor.now()
        folder = session_folder(recordings_folder(self._config), mission, anchor)
        try:
            session = self._open_session(folder, self._about(request, mission), self._config, anchor)
            session.start()
        except EdgeError as error:
            self.problem = str(error)
            raise
        self._session, self._folder, self.mission, self.problem = session, folder, mission, ""
        self.state = "recording"
        self._intake.session = session
        self._supervisor.session_started()
        log.info("recording session %s", folder.name)

    def _stop(self, reason: str) -> None:
        session = self._session
        if session is None:
            return
        self.state = "stopping"
        self._intake.session = None
        self._supervisor.session_stopped()
        try:
            result = session.stop(reason)
        finally:
            self._session, self.state = None, "idle"
        self.problem = result.error or (result.reason if result.reason != reason else "")
        log.info(
            "session %s: %s, %.1f s, %d messages", result.session, result.reason, result.duration_s, result.messages
        )
        self._judge.submit(result.folder)

    def _mark(self, text: str, receive_ns: int) -> None:
        if self._session is None:
            raise ControlError("nothing is being recorded, so nothing can be marked; start a recording first")
        self._session.offer(Mark(receive_ns, receive_ns, text or "mark"))

    def _validate(self, name: str) -> None:
        if self._session is not None:
            raise ControlError("a recording is running, and is validated when it stops; stop it first")
        folder = recordings_folder(self._config) / Path(name).name if name else self._folder
        if folder is None:
            raise ControlError("nothing was recorded since the recorder started; name the session")
        if not folder.is_dir():
            raise ControlError(f"{folder}: no such session; `ls {folder.parent}` lists them")
        self._folder = folder
        if self._judge.verdict is None or not self._judge.verdict.running or self._judge.verdict.session != folder.name:
            self._judge.submit(folder)

    def _check_session(self, wanted: str) -> None:
        if wanted and (self._folder is None or wanted != self._folder.name):
            now = f"{self._folder.name} is" if self._folder and self._session else "nothing is"
            raise ControlError(f"session {wanted!r} is not being recorded, {now}; nothing was stopped")

    def _about(self, request: Request, mission: str) -> SessionAbout:
        clock = self._system_clock()
        return SessionAbout(
            mission=mission,
            operator=request.operator or self._config.mission.operator,
            carrier=request.carrier or self._config.mission.carrier,
            software=SOFTWARE,
            config_toml=self._config_toml,
            host=platform.node(),
            clock_synchronised=clock.synchronised,
            clock_source=clock.source,
        )


def total_drops(status: RecordingStatus) -> int:
    """Messages the queue had no room for, over all topics."""
    return sum(drops.count for drops in status.dropped.values())
