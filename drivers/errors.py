"""Errors of the sensor drivers.

DriverError
├── ProtocolError      bytes that break the sensor's protocol
├── SensorRefused      the sensor answered, and said no
├── SensorUnreachable  nobody answers, or the link went away
├── SensorUnsupported  another model or firmware than this driver speaks
└── SimulationError    the simulated payload cannot be built or run as asked
"""


class DriverError(Exception):
    """Base of every error of a driver. The text says what happened, where, and what to do."""


class ProtocolError(DriverError):
    """Bytes that break the sensor's protocol."""


class SensorRefused(DriverError):
    """The sensor answered, and said no."""


class SensorUnreachable(DriverError, ConnectionError):
    """Nobody answers at the sensor's address, or the link went away."""


class SensorUnsupported(DriverError):
    """Another model or firmware than this driver speaks."""


class SimulationError(DriverError):
    """The simulated payload cannot be built or run as asked."""
