"""One look at everything a second: for the clients, for the file, for the watchdog."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Protocol

from drivers.driver import SensorHealth, SensorState
from edge.config import Config
from edge.control.messages import Detecting, Host, Location, Mapped, Recording, Status
from edge.paths import recordings_folder
from edge.recording.account import RecordingStatus
from edge.recording.disk import Disk, Space, floor_bytes
from edge.service.diagnostics import SystemClock, diagnostics
from edge.service.host import HostProbe, HostSample
from edge.service.host_clock import Discipline, StepWatch, discipline
from edge.service.intake import Intake
from edge.service.judge import Judge
from edge.service.progress import (
    RECEIVER_STALL_S,
    STOPPING_STALL_S,
    WRITER_STALL_S,
    Progress,
    Receiver,
    writer_stall_s,
)
from edge.service.recorder import Recorder, total_drops
from edge.service.states import gnss_state, sensor_state
from edge.service.supervisor import DriverRunner, Supervisor

STALL_TOLD_S = 2.5
"""A writer this long without progress is told: the flush every second should have shown some."""
STEP_TOLD_S = 60.0
_RATE_AFTER_S = 5.0
_MIB = 1 << 20


@dataclass(frozen=True)
class _Look:
    """What the last look saw."""

    sensors: tuple[SensorHealth, ...]
    host: HostSample
    discipline: Discipline
    space: Space
    alive: bool


class Words(Protocol):
    """`BusServer`, as far as it is used here: the live pipeline's last words, None where there are none."""

    @property
    def location(self) -> Location | None: ...
    @property
    def detecting(self) -> Detecting | None: ...
    @property
    def mapped(self) -> Mapped | None: ...


class Silence:
    """No live pipeline."""

    location = detecting = mapped = None


class Health:
    """Looks with `look` about once a second; `status` is cheap: what was seen then, with the session as it is now."""

    def __init__(
        self,
        config: Config,
        supervisor: Supervisor,
        intake: Intake,
        recorder: Recorder,
        judge: Judge,
        *,
        probe: HostProbe | None = None,
        steps: StepWatch | None = None,
        disk: Disk | None = None,
    ) -> None:
        self.notices: list[str] = []
        """Standing problems of the service itself: no live view, a file that could not be repaired."""
        self.pipeline: Words = Silence()
        """What the live pipeline says."""
        self._config = config
        self._supervisor = supervisor
        self._intake = intake
        self._recorder = recorder
        self._judge = judge
        self._probe = probe or HostProbe()
        self._steps = steps or StepWatch()
        self._disk = disk or Disk()
        self._progress = Progress()
        self._bytes_per_s = 0.0
        self._step_ns, self._step_seen_ns = 0, 0
        self._looked: _Look | None = None

    @property
    def alive(self) -> bool:
        """Whether writer and receivers got on, at the last look: what the watchdog is fed from."""
        return self._looked is not None and self._looked.alive

    def look(self, now_ns: int) -> _Look:
        """Ask every driver, the computer and its clock; put the answers into the recording."""
        self._watch_clock(now_ns)
        recording = self._recorder.session_status
        sensors, all_stuck = self._sensors(now_ns)
        self._looked = _Look(
            sensors,
            self._probe.sample(),
            discipline(),
            self._space(),
            not all_stuck and self._writes(recording, now_ns),
        )
        clock = SystemClock(self._steps.offset_ns, self._steps.steps, self._looked.discipline)
        told = diagnostics(now_ns, sensors, self._looked.host, clock, recording, detecting=self.pipeline.detecting)
        self._intake.take(told)
        return self._looked

    def status(self, now_ns: int) -> Status:
        """Everything a client shows."""
        looked = self._looked
        if looked is None:
            looked = self.look(now_ns)
        recording = self._recorder.session_status
        fix = self._intake.last_fix
        return Status(
            stamp_ns=time.time_ns(),
            state=self._recorder.state,
            sensors=tuple(sensor_state(health) for health in looked.sensors),
            host=self._host(looked, recording),
            gnss=gnss_state(fix, now_ns) if fix else None,
            recording=self._recording(recording) if recording else None,
            verdict=self._judge.verdict,
            problems=tuple(self._problems(looked, recording, now_ns)),
            location=self.pipeline.location,
            detecting=self.pipeline.detecting,
            mapped=self.pipeline.mapped,
        )

    def summary(self) -> str:
        """One line for `systemctl status`."""
        sensors = self._looked.sensors if self._looked else ()
        good = sum(health.state in (SensorState.OK, SensorState.DEGRADED) for health in sensors)
        recording = self._recorder.session_status
        doing = f"{self._recorder.state} {recording.session}" if recording else self._recorder.state
        return f"{doing}; {good} of {len(sensors)} sensors deliver"

    def _sensors(self, now_ns: int) -> tuple[tuple[SensorHealth, ...], bool]:
        """Health of all, those that stand still against their own word in red; whether that is all of them."""
        runners = self._supervisor.runners
        healths = tuple(runner.health() for runner in runners)
        receivers = [_receiver(runner, health) for runner, health in zip(runners, healths, strict=True)]
        stuck, all_stuck = self._progress.stuck_receivers(receivers, now_ns)
        return tuple(_stuck(health) if health.name in stuck else health for health in healths), all_stuck

    def _writes(self, recording: RecordingStatus | None, now_ns: int) -> bool:
        if recording is None or recording.ended:
            return True
        limit_s = STOPPING_STALL_S if self._recorder.state == "stopping" else WRITER_STALL_S
        return writer_stall_s(recording.last_progress_ns, now_ns) < limit_s

    def _watch_clock(self, now_ns: int) -> None:
        # The writer puts the step into the file by itself; here it is told to the operator.
        if step_ns := self._steps.look():
            self._step_ns, self._step_seen_ns = step_ns, now_ns

    def _space(self) -> Space:
        folder = recordings_folder(self._config).absolute()
        existing = next(place for place in (folder, *folder.parents) if place.exists())
        return self._disk.space(existing)

    def _floor_bytes(self, space: Space) -> int:
        limits = self._config.recording
        return floor_bytes(space, limits.min_free_mib, limits.min_free_percent)

    def _host(self, looked: _Look, recording: RecordingStatus | None) -> Host:
        if recording is not None and recording.elapsed_s > _RATE_AFTER_S:
            self._bytes_per_s = recording.bytes_written / recording.elapsed_s
        room = max(0, looked.space.free_bytes - self._floor_bytes(looked.space))
        return Host(
            cpu_percent=looked.host.cpu_percent,
            memory_percent=looked.host.memory_percent,
            temperature_c=looked.host.temperature_c,
            throttled=looked.host.throttled,
            disk_free_bytes=looked.space.free_bytes,
            disk_remaining_s=room / self._bytes_per_s if self._bytes_per_s > 0 else None,
            battery_remaining_s=looked.host.battery_remaining_s,
            queue_fill=recording.queue_fill if recording else 0.0,
            clock_synchronised=looked.discipline.synchronised,
            clock_source=looked.discipline.source,
        )

    def _recording(self, status: RecordingStatus) -> Recording:
        return Recording(
            session=status.session,
            folder=status.folder,
            mission=self._recorder.mission,
            elapsed_s=status.elapsed_s,
            bytes_written=status.bytes_written,
            messages=status.messages,
            dropped=total_drops(status),
            marks=status.marks,
            flush_ms=status.flush_ms,
            split=status.split,
        )

    def _problems(self, looked: _Look, recording: RecordingStatus | None, now_ns: int) -> list[str]:
        problems = [self._recorder.problem] if self._recorder.problem else []
        if recording is not None:
            problems += [text for text in (recording.error, recording.ended) if text]
            stall_s = writer_stall_s(recording.last_progress_ns, now_ns)
            if stall_s > STALL_TOLD_S:
                problems.append(
                    f"the card has taken no data for {stall_s:.0f} s; the queue is {recording.queue_fill:.0%} full. "
                    "If this repeats, use a faster card"
                )
        elif looked.space.free_bytes < self._floor_bytes(looked.space):
            problems.append(
                f"only {looked.space.free_bytes // _MIB} MiB free at {recordings_folder(self._config)}, "
                f"{self._floor_bytes(looked.space) // _MIB} MiB must stay free: no recording can start; "
                "copy recordings off and delete them"
            )
        if self._step_seen_ns and now_ns - self._step_seen_ns < STEP_TOLD_S * 1e9:
            problems.append(
                f"the system clock stepped by {self._step_ns / 1e9:+.3f} s; session time goes on, all is well"
            )
        return problems + self.notices


def _receiver(runner: DriverRunner, health: SensorHealth) -> Receiver:
    claims = health.state in (SensorState.OK, SensorState.DEGRADED)
    delivers = claims and any(stream.expected_hz > 0 for stream in health.streams)
    return Receiver(runner.name, delivers, runner.received)


def _stuck(health: SensorHealth) -> SensorHealth:
    return replace(
        health,
        state=SensorState.FAILED,
        problem=f"its receiver stands still: no message for {RECEIVER_STALL_S:g} s",
        advice="finish the recording, then restart the recorder (`sudo systemctl restart mapforest-recorder`)",
    )
