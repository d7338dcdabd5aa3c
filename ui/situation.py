"""Everything the screen shows at one instant."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from edge.control.messages import Status

SILENT_S = 3.0
"""The recorder sends about four statuses a second; after this long without one they are old news."""


class Link(Enum):
    """The connection to the recorder."""

    CONNECTING = "connecting"
    ONLINE = "online"
    LOST = "lost"


@dataclass(frozen=True)
class Situation:
    """The newest status, how old it is, and what the operator is in the middle of.

    status_age_s: since it arrived here. armed_s: time left for the second press that stops, 0 when not asked for.
    link_problem: why the recorder cannot be reached.
    """

    link: Link = Link.CONNECTING
    status: Status | None = None
    status_age_s: float = 0.0
    armed_s: float = 0.0
    link_problem: str = ""

    @property
    def stale(self) -> bool:
        """Whether what is shown may no longer be so."""
        return self.link is not Link.ONLINE or self.status is None or self.status_age_s > SILENT_S

    @property
    def state(self) -> str:
        """The recorder's last known state: idle, recording, stopping, or empty."""
        return self.status.state if self.status else ""
