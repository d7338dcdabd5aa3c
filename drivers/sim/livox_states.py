"""The states of the emulated Mid-360 and how long each takes, as measured on hardware (reference sheet, section 5)."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.livox.status import WorkState

SELFCHECK_S = 4.9
FIRST_PACKET_S = 11.02
"""From power-on to the first point packet."""
SPIN_UP_S = 6.1
SPIN_UP_AFTER_STOP_S = 10.1
JUST_STOPPED_S = 5.0
LASER_ON_S = 0.02
SPIN_DOWN_S = 0.5
REBOOT_DATA_S = 1.25
REBOOT_SILENT_UNTIL_S = 8.9
REBOOT_SAMPLING_S = 13.56


@dataclass(frozen=True, slots=True)
class Phase:
    """A state to come. `reachable`: answers commands and pushes. `power_on_ns` is given when the device starts anew."""

    due_ns: int
    state: WorkState
    streaming: bool = False
    reachable: bool = True
    power_on_ns: int | None = None


class StateMachine:
    """Where the device is, and what it has planned. Times are host ns; `scale` shortens all durations."""

    def __init__(self, power_on_ns: int, scale: float) -> None:
        self._scale = scale
        self._stopped_ns: int | None = None
        self.power_on_ns = power_on_ns
        self.reboots = 0
        self._phase = Phase(power_on_ns, WorkState.SELFCHECK)
        spinning_ns = self._after(power_on_ns, SELFCHECK_S)
        self._plan = [
            Phase(spinning_ns, WorkState.MOTOR_STARTUP),
            *self._start_plan(self._after(power_on_ns, FIRST_PACKET_S)),
        ]

    @property
    def state(self) -> WorkState:
        """What the device says of itself."""
        return self._phase.state

    @property
    def streaming(self) -> bool:
        """Whether points and IMU samples leave it."""
        return self._phase.streaming

    @property
    def reachable(self) -> bool:
        """Whether it answers and pushes."""
        return self._phase.reachable

    def advance(self, now_ns: int) -> bool:
        """Enter the phases that are due. True when the device started anew: its clock and counters begin at zero."""
        restarted = False
        while self._plan and self._plan[0].due_ns <= now_ns:
            self._phase = self._plan.pop(0)
            if self._phase.power_on_ns is not None:
                self.power_on_ns = self._phase.power_on_ns
                self.reboots += 1
                restarted = True
        return restarted

    def aim(self, target: WorkState, now_ns: int) -> None:
        """Take a new target state, on the way the hardware takes."""
        if not self._phase.reachable or any(phase.power_on_ns for phase in self._plan):
            return
        spinning = self.state in (WorkState.SAMPLING, WorkState.READY)
        if target is WorkState.SAMPLING:
            if not spinning and self.state is not WorkState.MOTOR_STARTUP:
                self._spin_up(now_ns)
            elif self.state is WorkState.READY:
                self._plan = [Phase(self._after(now_ns, LASER_ON_S), WorkState.SAMPLING, streaming=True)]
        elif target is WorkState.READY:
            self._plan = [Phase(now_ns, WorkState.READY)] if spinning else self._plan
        elif spinning:
            self._stopped_ns = now_ns
            self._plan = [Phase(now_ns, WorkState.READY), Phase(self._after(now_ns, SPIN_DOWN_S), WorkState.IDLE)]
        else:
            self._plan = [Phase(now_ns, WorkState.IDLE)]

    def reboot(self, at_ns: int) -> None:
        """Start anew: data for 1.25 s more, silence, then up again on a clock that counts from zero."""
        sampling_ns = self._after(at_ns, REBOOT_SAMPLING_S)
        back_ns = self._after(at_ns, REBOOT_SILENT_UNTIL_S)
        self._plan = [
            Phase(at_ns, WorkState.ERROR, streaming=self._phase.streaming),
            Phase(self._after(at_ns, REBOOT_DATA_S), WorkState.ERROR, reachable=False),
            Phase(back_ns, WorkState.MOTOR_STARTUP, power_on_ns=self._after(sampling_ns, -FIRST_PACKET_S)),
            *self._start_plan(sampling_ns),
        ]

    def _spin_up(self, now_ns: int) -> None:
        just_stopped = self._stopped_ns is not None and now_ns < self._after(self._stopped_ns, JUST_STOPPED_S)
        duration_s = SPIN_UP_AFTER_STOP_S if just_stopped else SPIN_UP_S
        self._plan = [Phase(now_ns, WorkState.MOTOR_STARTUP), *self._start_plan(self._after(now_ns, duration_s))]

    def _start_plan(self, sampling_ns: int) -> list[Phase]:
        return [
            Phase(self._after(sampling_ns, -LASER_ON_S), WorkState.READY),
            Phase(sampling_ns, WorkState.SAMPLING, streaming=True),
        ]

    def _after(self, since_ns: int, seconds: float) -> int:
        return since_ns + round(seconds * self._scale * 1e9)
