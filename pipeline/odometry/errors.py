"""What the odometry refuses."""


class OdometryError(Exception):
    """Base of what the odometry raises.

    OdometryError
    `-- StartRefused      the data cannot give a first state; the message says why
    """


TRIED = 10
"""Scans left out after a try to start in motion, which takes as long as a hundred of them do."""


class StartRefused(OdometryError):
    """The data cannot give attitude, velocity and biases yet. scans: so many are to be left out before the next try."""

    def __init__(self, text: str, scans: int = 1) -> None:
        super().__init__(text)
        self.scans = scans
