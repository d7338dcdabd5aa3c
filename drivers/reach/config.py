"""Configuration of the Reach driver."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec

from drivers.errors import DriverError

DEFAULT_TCP_PORT = 9001
"""Reach has no default port: the operator picks one from 3000 up, and 9001 is the usual choice."""


class Config(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One Reach receiver, set to NMEA: GGA, RMC and GST at `rate_hz`, ZDA at 1 Hz, GSV and GSA off or at 1 Hz."""

    endpoint: str = "serial:auto"
    """`serial:auto`, `serial:/dev/mapforest/gnss` or `tcp:192.168.2.15:9001`. `auto` takes the first of
    /dev/mapforest/gnss, a Reach in /dev/serial/by-id, a USB port of vendor 3032 and product 0013."""
    baud: int = 115200
    """Over USB any rate works; over the UART it must be what the receiver is set to."""
    rate_hz: float = 5.0
    """Rate of GGA the receiver is set to; 10 Hz at most."""
    reconnect_s: float = 0.5
    """Pause between attempts to open the link."""
    silence_s: float = 10.0
    """A TCP link silent for so long is opened anew: a dead peer does not say so."""
    correction_age_limit_s: float = 10.0
    """Corrections older than this are reported: normal is 1 to 2 s."""
    latency_ms: float = 0.0
    """Constant delay from the instant of measurement to the first byte, where it has been measured."""

    def __post_init__(self) -> None:
        parse_endpoint(self.endpoint)
        for name in ("baud", "rate_hz", "reconnect_s", "silence_s", "correction_age_limit_s"):
            if getattr(self, name) <= 0:
                raise ValueError(f"{name} is {getattr(self, name)}: it must be above 0")


@dataclass(frozen=True, slots=True)
class SerialEndpoint:
    """A serial device; an empty path looks for a Reach."""

    path: str


@dataclass(frozen=True, slots=True)
class TcpEndpoint:
    """A TCP server."""

    host: str
    port: int


class EndpointError(DriverError, ValueError):
    """An endpoint that cannot be understood."""


def parse_endpoint(text: str) -> SerialEndpoint | TcpEndpoint:
    """EndpointError (a ValueError) says what is expected."""
    kind, _, rest = text.partition(":")
    if kind == "serial" and rest == "auto":
        return SerialEndpoint("")
    if kind == "serial" and rest.startswith("/"):
        return SerialEndpoint(rest)
    if kind == "tcp" and rest:
        host, colon, port = rest.rpartition(":")
        if not colon:
            return TcpEndpoint(rest, DEFAULT_TCP_PORT)
        if host and port.isdecimal() and 0 < int(port) < 65536:
            return TcpEndpoint(host, int(port))
    raise EndpointError(
        f"endpoint {text!r}: expected serial:auto, serial:/dev/... or tcp:host:port, for example tcp:192.168.2.15:9001"
    )
