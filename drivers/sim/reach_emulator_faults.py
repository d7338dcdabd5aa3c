"""What may befall a burst of sentences on its way out."""

from __future__ import annotations

import random

from drivers.sim.faults import FaultPlan


class LineFaults:
    """Losses, repetitions, disorder, damage and foreign bytes, as the fault plan says. Seeded."""

    def __init__(self, plan: FaultPlan, period_s: float, seed: int) -> None:
        self._plan = plan
        self._period_s = period_s
        self._random = random.Random(seed)

    def apply(self, burst: list[bytes], t_s: float) -> list[bytes]:
        """The burst as it goes out at `t_s`: sentences and pieces of other protocols."""
        sent: list[bytes] = []
        for sentence in burst:
            if self._happens("loss", t_s):
                continue
            sent.append(self._damaged(sentence) if self._happens("corrupt", t_s) else sentence)
            if self._happens("duplicate", t_s):
                sent.append(sent[-1])
        for k in range(len(sent) - 1):
            if self._happens("reorder", t_s):
                sent[k], sent[k + 1] = sent[k + 1], sent[k]
        return self._with_garbage(sent, t_s)

    def delay_s(self, t_s: float) -> float:
        mean_s = self._plan.level("delay_jitter", t_s)
        return self._random.expovariate(1.0 / mean_s) if mean_s > 0.0 else 0.0

    def _happens(self, kind: str, t_s: float) -> bool:
        share = self._plan.level(kind, t_s)
        return share > 0.0 and self._random.random() < share

    def _damaged(self, sentence: bytes) -> bytes:
        damaged = bytearray(sentence)
        damaged[self._random.randrange(len(damaged))] ^= 1 << self._random.randrange(8)
        return bytes(damaged)

    def _with_garbage(self, sent: list[bytes], t_s: float) -> list[bytes]:
        left = round(self._plan.level("garbage", t_s) * self._period_s)
        mixed = list(sent)
        while left > 0:
            piece = self._garbage(min(left, self._random.randint(8, 120)))
            mixed.insert(self._random.randint(0, len(mixed)), piece)
            left -= len(piece)
        return mixed

    def _garbage(self, size: int) -> bytes:
        """A UBX or RTCM3 frame, or noise; `$` may well be in it."""
        payload = self._random.randbytes(size)
        head = self._random.choice((b"\xb5\x62\x01\x07", b"\xd3\x00" + bytes([size & 0xFF]), b"", b"$"))
        return head + payload
