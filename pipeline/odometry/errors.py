"""What the odometry refuses."""


class OdometryError(Exception):
    """Base of what the odometry raises.

    OdometryError
    `-- StartRefused      the data cannot give a first state; the message says why
    """


class StartRefused(OdometryError):
    """The data cannot give attitude, velocity and biases yet."""
