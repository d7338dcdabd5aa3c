"""NMEA as Reach M2 writes it: order, fields and digits of a real epoch (2023 firmware), checksums included."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime, timezone

from drivers.sim.gnss_geodesy import Datum
from drivers.sim.sources import GnssEpoch

_M_S_KNOT = 3600.0 / 1852.0
_MINUTE_UNITS = 10**7
"""Minutes have seven decimals: about 0.2 mm."""
_CONSTELLATIONS = (("GP", 1, 0.4), ("GL", 65, 0.2), ("GA", 1, 0.25), ("GB", 11, 0.15))
"""Talker, first satellite number, share of the satellites."""


@dataclass(frozen=True, slots=True)
class SentenceSet:
    """Which sentences the receiver is set to send: GGA, RMC and GST every epoch, the others once a second."""

    talker: str = "GN"
    satellites: bool = True
    """GSA and GSV, the bulk of the bytes."""
    velocity: bool = True
    """VTG."""
    date: bool = True
    """ZDA."""
    base: Datum | None = None
    """EBP: empty until the base is known."""
    timed_no_fix: bool = False
    """Without a fix: quality 0 with time, as other receivers, and not the empty sentences of RTKLIB."""


def sentences(epoch: GnssEpoch, utc_ns: int, config: SentenceSet, knows_time: bool = True) -> list[bytes]:
    """The burst of one epoch, in Reach's order, each sentence with its line end."""
    utc = datetime.fromtimestamp(utc_ns // 1_000_000_000, timezone.utc)
    clock = f"{utc:%H%M%S}.{utc_ns // 10_000_000 % 100:02d}"
    whole_second = utc_ns % 1_000_000_000 == 0
    has_fix = epoch.quality != 0
    timed = knows_time and (has_fix or config.timed_no_fix)
    bodies = [_rmc(epoch, clock, utc, has_fix, timed), _gga(epoch, clock, has_fix, timed)]
    if whole_second and config.satellites:
        bodies += _gsa(epoch) + _gsv(epoch)
    if whole_second and config.velocity:
        bodies.append(_vtg(epoch) if has_fix else "VTG,,,,,,,,,N")
    bodies.append(_gst(epoch, clock) if has_fix else "GST,,,,,,,,")
    if whole_second and config.date:
        bodies.append(f"ZDA,{clock},{utc:%d,%m,%Y},00,00" if timed else "ZDA,,,,,,")
    if whole_second:
        bodies.append(_ebp(config.base))
    return [sentence(body if body[:2] in _TALKERS else config.talker + body) for body in bodies]


def sentence(body: str) -> bytes:
    """`$`, body, checksum, line end."""
    value = 0
    for byte in body.encode("ascii"):
        value ^= byte
    return f"${body}*{value:02X}\r\n".encode("ascii")


def angle(degrees: float, digits: int) -> str:
    """`dddmm.mmmmmmm` with so many digits of degrees; never 60 minutes."""
    whole, units = divmod(round(abs(degrees) * 60 * _MINUTE_UNITS), 60 * _MINUTE_UNITS)
    return f"{whole:0{digits}d}{units // _MINUTE_UNITS:02d}.{units % _MINUTE_UNITS:07d}"


_TALKERS = tuple(talker for talker, _, _ in _CONSTELLATIONS)


def _position(latitude_deg: float, longitude_deg: float) -> str:
    north = "N" if latitude_deg >= 0 else "S"
    east = "E" if longitude_deg >= 0 else "W"
    return f"{angle(latitude_deg, 2)},{north},{angle(longitude_deg, 3)},{east}"


def _rmc(epoch: GnssEpoch, clock: str, utc: datetime, has_fix: bool, timed: bool) -> str:
    if not has_fix:
        return f"RMC,{clock},V,,,,,,,{utc:%d%m%y},,,N" if timed else "RMC,,,,,,,,,,,,"
    mode = "A" if epoch.quality == 1 else "D"
    position = _position(epoch.latitude_deg, epoch.longitude_deg)
    knots = epoch.speed_m_s * _M_S_KNOT
    return f"RMC,{clock},A,{position},{knots:.2f},{epoch.course_deg:.2f},{utc:%d%m%y},,,{mode}"


def _gga(epoch: GnssEpoch, clock: str, has_fix: bool, timed: bool) -> str:
    if not has_fix:
        return f"GGA,{clock},,,,,0,{epoch.satellites:02d},,,M,,M,," if timed else "GGA,,,,,,,,,,,,,,"
    position = _position(epoch.latitude_deg, epoch.longitude_deg)
    altitude_m = epoch.height_m - epoch.geoid_separation_m
    age_s = 0.0 if epoch.age_s is None else epoch.age_s
    return (
        f"GGA,{clock},{position},{epoch.quality},{epoch.satellites:02d},{epoch.hdop:.1f},"
        f"{altitude_m:.3f},M,{epoch.geoid_separation_m:.3f},M,{age_s:.1f},"
    )


def _gst(epoch: GnssEpoch, clock: str) -> str:
    """Reach leaves the ellipse empty; its RMS is a figure of the ranges, well above the sigmas."""
    east_m, north_m, up_m = epoch.sigma_enu_m
    rms_m = 2.0 * math.hypot(east_m, north_m, up_m)
    return f"GST,{clock},{rms_m:.3f},,,,{north_m:.3f},{east_m:.3f},{up_m:.3f}"


def _vtg(epoch: GnssEpoch) -> str:
    mode = "A" if epoch.quality == 1 else "D"
    knots = epoch.speed_m_s * _M_S_KNOT
    return f"VTG,{epoch.course_deg:.2f},T,,M,{knots:.2f},N,{epoch.speed_m_s * 3.6:.2f},K,{mode}"


def _ebp(base: Datum | None) -> str:
    if base is None:
        return "EBP,,,,,,M"
    return f"EBP,{_position(base.latitude_deg, base.longitude_deg)},{base.height_m:.3f},M"


def _used(epoch: GnssEpoch) -> list[tuple[str, list[int]]]:
    """Satellite numbers by talker."""
    return [
        (talker, [first + 2 * k for k in range(round(share * epoch.satellites))])
        for talker, first, share in _CONSTELLATIONS
    ]


def _gsa(epoch: GnssEpoch) -> list[str]:
    hdop = 9.9 if math.isnan(epoch.hdop) else epoch.hdop
    dops = f"{1.5 * hdop:.1f},{hdop:.1f},{1.1 * hdop:.1f}"
    kind = 1 if epoch.quality == 0 else 3
    return [
        f"{talker}GSA,A,{kind},{','.join(f'{n:02d}' for n in numbers[:12])}{',' * (12 - len(numbers[:12]))},{dops}"
        if numbers
        else f"{talker}GSA,A,{kind},{',' * 11},{dops}"
        for talker, numbers in _used(epoch)
    ]


def _gsv(epoch: GnssEpoch) -> list[str]:
    """Four satellites a sentence, empty slots padded; elevations and azimuths are made up from the number."""
    bodies = []
    for talker, numbers in _used(epoch):
        pages = [numbers[k : k + 4] for k in range(0, len(numbers), 4)] or [[]]
        for page, seen in enumerate(pages, 1):
            slots = [f"{n:02d},{10 + n * 7 % 75:02d},{n * 37 % 360:03d},{25 + n % 20}" for n in seen]
            slots += [",,,"] * (4 - len(slots))
            bodies.append(f"{talker}GSV,{len(pages)},{page},{len(numbers):02d},{','.join(slots)}")
    return bodies
