"""Requests on their way: each gets a number, and an answer or a reminder that none came."""

from __future__ import annotations

from dataclasses import dataclass, field

import msgspec

from edge.control.messages import Reply, Request

ANSWER_S = 5.0
"""A start is answered in well under a second; beyond this the operator should know."""


@dataclass
class Requests:
    """Those not answered yet, by number."""

    _open: dict[int, tuple[Request, float]] = field(default_factory=dict)
    _last_id: int = 0

    def number(self, request: Request, now_s: float) -> Request:
        """The request as it is to be sent."""
        self._last_id += 1
        numbered = msgspec.structs.replace(request, id=self._last_id)
        self._open[numbered.id] = (numbered, now_s)
        return numbered

    def answered(self, reply: Reply) -> Request | None:
        """What `reply` answers; None for what was not asked here."""
        return self._open.pop(reply.id, (None, 0.0))[0]

    def overdue(self, now_s: float) -> tuple[Request, ...]:
        """Those that waited too long, each returned once. They stay open: a late answer is still an answer."""
        late = {number for number, (_, since_s) in self._open.items() if now_s - since_s > ANSWER_S}
        for number in late:
            self._open[number] = (self._open[number][0], float("inf"))
        return tuple(self._open[number][0] for number in sorted(late))

    def forget(self) -> None:
        """The connection broke: what was on its way is not answered any more."""
        self._open.clear()
