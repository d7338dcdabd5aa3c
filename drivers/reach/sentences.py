"""Sentences to typed records. pynmea2 gives the names of the fields; their texts are converted here.

pynmea2's own conversions are not used: an empty position becomes 0 N 0 E, a number it cannot convert stays text,
and `is_valid` is False for every RMC of NMEA 4.1. Only the three-letter type counts, for talkers change in mid-stream.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import pynmea2

from drivers.errors import ProtocolError
from drivers.messages import FixQuality
from drivers.reach.utc import midnight_ms, time_of_day_ms

KNOT_M_S = 1852.0 / 3600.0
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)")
_ANGLE = re.compile(r"([0-9]{1,3})([0-5][0-9](?:\.[0-9]*)?)")


class EBP(pynmea2.TalkerSentence):  # type: ignore[misc]
    """Emlid's own sentence: the position of the base. pynmea2 finds it by the name of this class."""

    fields = (
        ("Latitude", "lat"),
        ("Latitude Direction", "lat_dir"),
        ("Longitude", "lon"),
        ("Longitude Direction", "lon_dir"),
        ("Ellipsoidal height", "height"),
        ("Units of height", "height_units"),
    )


@dataclass(frozen=True, slots=True)
class Gga:
    """Position. `position_deg` (latitude, longitude) is None without a fix, whatever the fields hold."""

    time_ms: int | None
    quality: FixQuality
    position_deg: tuple[float, float] | None
    satellites: int
    hdop: float | None
    altitude_m: float | None
    """Above mean sea level."""
    separation_m: float | None
    age_s: float | None
    station: str


@dataclass(frozen=True, slots=True)
class Rmc:
    """Velocity and date."""

    time_ms: int | None
    active: bool
    date_ms: int | None
    speed_m_s: float | None
    course_deg: float | None


@dataclass(frozen=True, slots=True)
class Gst:
    """One-sigma errors in metres. ellipse: semi-major, semi-minor, degrees of the major axis from true north."""

    time_ms: int | None
    rms_m: float | None
    ellipse: tuple[float, float, float] | None
    north_m: float | None
    east_m: float | None
    up_m: float | None


@dataclass(frozen=True, slots=True)
class Zda:
    """Full date."""

    time_ms: int | None
    date_ms: int | None


@dataclass(frozen=True, slots=True)
class Ebp:
    """Position of the base, never of the rover; height above the ellipsoid."""

    position_deg: tuple[float, float] | None
    height_m: float | None


Record: TypeAlias = Gga | Rmc | Gst | Zda | Ebp


def parse(sentence: str) -> Record | None:
    """The record in a sentence with a good checksum; None for types of no interest. ProtocolError for broken fields."""
    convert = _CONVERT.get(sentence[3:7])
    if convert is None:
        return None
    try:
        message = pynmea2.parse(sentence, check=True)
    except pynmea2.ParseError as error:
        raise ProtocolError(f"{sentence}: {error.args[0][0]}") from error
    try:
        return convert(_Fields(message))
    except ProtocolError as error:
        raise ProtocolError(f"{sentence}: {error}") from error


class _Fields:
    """Texts of one sentence by pynmea2's field names; fields the sender left out are empty."""

    def __init__(self, message: Any) -> None:
        self._data: list[str] = message.data
        self._index: dict[str, int] = message.name_to_idx

    def text(self, name: str) -> str:
        index = self._index[name]
        return self._data[index].strip() if index < len(self._data) else ""

    def number(self, name: str) -> float | None:
        text = self.text(name)
        if not text:
            return None
        if _NUMBER.fullmatch(text) is None:
            raise ProtocolError(f"{text!r} is no number ({name})")
        return float(text)

    def count(self, name: str) -> int:
        text = self.text(name)
        if text and not text.isdecimal():
            raise ProtocolError(f"{text!r} is no count ({name})")
        return int(text or 0)

    def position(self) -> tuple[float, float] | None:
        latitude = _angle(self.text("lat"), self.text("lat_dir"), "NS", 90.0)
        longitude = _angle(self.text("lon"), self.text("lon_dir"), "EW", 180.0)
        if latitude is None or longitude is None or latitude == longitude == 0.0:
            return None
        return latitude, longitude


def _angle(text: str, direction: str, directions: str, limit_deg: float) -> float | None:
    """Degrees of `dddmm.mmmm`, the second of `directions` negative."""
    if not text or not direction:
        return None
    match = _ANGLE.fullmatch(text)
    if match is None or direction not in directions:
        raise ProtocolError(f"{text!r} {direction!r} is no angle (dddmm.mmmm, {directions})")
    degrees = int(match[1]) + float(match[2]) / 60.0
    if degrees > limit_deg:
        raise ProtocolError(f"{text!r} is beyond {limit_deg:.0f} degrees")
    return degrees if direction == directions[0] else -degrees


def _gga(fields: _Fields) -> Gga:
    position = fields.position()
    code = fields.count("gps_qual")
    # Codes above 8 are vendors' own kinds of differential fix: claim the least.
    quality = FixQuality(code) if code <= 8 else FixQuality.SINGLE
    if position is None or quality is FixQuality.INVALID:
        position, quality = None, FixQuality.INVALID
    return Gga(
        time_ms=time_of_day_ms(fields.text("timestamp")),
        quality=quality,
        position_deg=position,
        satellites=fields.count("num_sats"),
        hdop=fields.number("horizontal_dil"),
        altitude_m=fields.number("altitude"),
        separation_m=fields.number("geo_sep"),
        age_s=fields.number("age_gps_data"),
        station=fields.text("ref_station_id"),
    )


def _rmc(fields: _Fields) -> Rmc:
    knots = fields.number("spd_over_grnd")
    date = fields.text("datestamp")
    if date and len(date) != 6:
        raise ProtocolError(f"{date!r} is no date (ddmmyy)")
    return Rmc(
        time_ms=time_of_day_ms(fields.text("timestamp")),
        active=fields.text("status") == "A",
        date_ms=midnight_ms(date[:2], date[2:4], date[4:]),
        speed_m_s=None if knots is None else knots * KNOT_M_S,
        course_deg=fields.number("true_course"),
    )


def _gst(fields: _Fields) -> Gst:
    major, minor = fields.number("std_dev_major"), fields.number("std_dev_minor")
    orientation = fields.number("orientation")
    given = major is not None and minor is not None and orientation is not None
    return Gst(
        time_ms=time_of_day_ms(fields.text("timestamp")),
        rms_m=fields.number("rms"),
        ellipse=(major, minor, orientation) if given else None,  # type: ignore[arg-type]
        north_m=fields.number("std_dev_latitude"),
        east_m=fields.number("std_dev_longitude"),
        up_m=fields.number("std_dev_altitude"),
    )


def _zda(fields: _Fields) -> Zda:
    return Zda(
        time_ms=time_of_day_ms(fields.text("timestamp")),
        date_ms=midnight_ms(fields.text("day"), fields.text("month"), fields.text("year")),
    )


def _ebp(fields: _Fields) -> Ebp:
    return Ebp(fields.position(), fields.number("height"))


_CONVERT: dict[str, Callable[[_Fields], Record]] = {
    "GGA,": _gga,
    "RMC,": _rmc,
    "GST,": _gst,
    "ZDA,": _zda,
    "EBP,": _ebp,
}
