"""The camera's clock and the bad link between it and the host, as a fault plan wants them."""

from __future__ import annotations

from random import Random

from drivers.sim.faults import FaultPlan

ORIGIN_LIMIT_S = 80_000
"""Origins of the stream clock: 33 bits of 90 kHz wrap at 95443 s, so a walk of some hours does not."""


class StreamClock:
    """The camera's 90 kHz clock in nanoseconds, never wrapped. Ask with increasing times."""

    def __init__(self, plan: FaultPlan, random: Random, origin_ns: int | None = None) -> None:
        self._plan = plan
        self._random = random
        self._t_ns = 0
        self._sensor_ns = float(self._new_origin() if origin_ns is None else origin_ns)

    def at(self, t_ns: int) -> int:
        """Sensor time at a walk time, drift and steps included."""
        t_s = t_ns / 1e9
        elapsed_ns = t_ns - self._t_ns
        self._t_ns = t_ns
        steps_s = sum(fault.value for fault in self._plan.due("clock_step", t_s))
        self._sensor_ns += elapsed_ns * (1 + self._plan.level("clock_drift", t_s) * 1e-6) + steps_s * 1e9
        return round(self._sensor_ns)

    def reboot(self) -> None:
        """A new origin."""
        self._sensor_ns = float(self._new_origin())

    def _new_origin(self) -> int:
        return self._random.randrange(1, ORIGIN_LIMIT_S) * 1_000_000_000


class BadLine:
    """Loses, doubles, swaps and corrupts datagrams, and puts rubbish between them."""

    def __init__(self, plan: FaultPlan, random: Random) -> None:
        self._plan = plan
        self._random = random
        self._late: bytes | None = None

    def carry(self, datagram: bytes, t_s: float) -> list[bytes]:
        """What arrives of one datagram, in order."""
        plan, random = self._plan, self._random
        if random.random() < plan.level("loss", t_s):
            return []
        if random.random() < plan.level("corrupt", t_s):
            datagram = _flip(datagram, random)
        if self._late is None and random.random() < plan.level("reorder", t_s):
            self._late = datagram
            return []
        late, self._late = self._late, None
        arriving = [datagram] if late is None else [datagram, late]
        return arriving * 2 if len(arriving) == 1 and random.random() < plan.level("duplicate", t_s) else arriving

    def rubbish(self, t_s: float, elapsed_s: float) -> list[bytes]:
        """Random datagrams of a stretch of time."""
        expected = self._plan.level("garbage", t_s) * elapsed_s
        count = int(expected) + (self._random.random() < expected % 1)
        return [self._random.randbytes(self._random.randrange(1, 1400)) for _ in range(count)]

    def delay_s(self, t_s: float) -> float:
        """Extra delay of a burst."""
        mean_s = self._plan.level("delay_jitter", t_s)
        return self._random.expovariate(1 / mean_s) if mean_s > 0 else 0.0


def _flip(datagram: bytes, random: Random) -> bytes:
    flipped = bytearray(datagram)
    flipped[random.randrange(len(flipped))] ^= 1 << random.randrange(8)
    return bytes(flipped)
