"""Where a GoPro is on USB: it is the .51 of the little network that it makes itself (section 1 of the sheet)."""

from __future__ import annotations

import fcntl
import socket
import struct
from collections.abc import Callable
from pathlib import Path

from drivers.errors import SensorUnreachable

VENDOR = "2672"
_SIOCGIFADDR = 0x8915


def address_of_serial(serial: str) -> str:
    """172.2X.1YZ.51 from the last three digits. SensorUnreachable when they are no digits."""
    digits = serial[-3:]
    if len(digits) < 3 or not digits.isdecimal():
        raise SensorUnreachable(f"serial {serial!r} does not end in three digits: correct it, or set an address")
    return f"172.2{digits[0]}.1{digits[1:]}.51"


def interface_address(interface: str) -> str:
    """IPv4 address of a network interface; empty when it has none yet."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            answer = fcntl.ioctl(probe.fileno(), _SIOCGIFADDR, struct.pack("256s", interface[:15].encode()))
        except OSError:
            return ""
    return socket.inet_ntoa(answer[20:24])


def find(network: Path = Path("/sys/class/net"), address_of: Callable[[str], str] = interface_address) -> str:
    """Address of the camera behind the interface with GoPro's vendor id. SensorUnreachable says what is missing."""
    interfaces = [link.name for link in sorted(network.glob("*")) if _vendor(link) == VENDOR]
    if not interfaces:
        raise SensorUnreachable("no GoPro on USB. In its menu set Connections > USB to GoPro Connect, then plug it in")
    for name in interfaces:
        own = address_of(name)
        if own.startswith("172.2"):
            return f"{own.rpartition('.')[0]}.51"
    raise SensorUnreachable(
        f"the GoPro's interface {interfaces[0]} has no address of its network: it takes up to 30 s; then use DHCP on it"
    )


def _vendor(link: Path) -> str:
    """The interface hangs below its USB device: a function of it, one or two folders down."""
    device = (link / "device").resolve()
    for folder in (device, *list(device.parents)[:2]):
        if (folder / "idVendor").is_file():
            return (folder / "idVendor").read_text().strip()
    return ""
