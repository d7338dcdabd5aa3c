"""What the connection tells the app. It posts these and touches nothing else."""

from __future__ import annotations

from dataclasses import dataclass

from textual.message import Message

from edge.control.messages import Reply, Status


@dataclass
class Connected(Message):
    """The recorder answers."""


@dataclass
class ConnectionLost(Message):
    """The recorder went away, or is not there yet. The connection keeps trying."""

    problem: str


@dataclass
class StatusArrived(Message):
    """A newer status."""

    status: Status

    def can_replace(self, message: Message) -> bool:
        """A backlog collapses to the newest."""
        return isinstance(message, StatusArrived)


@dataclass
class Replied(Message):
    """The answer to a request."""

    reply: Reply
