"""Time of day and date of NMEA, in integer milliseconds: `23:59:60.xx`, a leap second, is 86,400,xxx."""

from __future__ import annotations

import re
from datetime import date

from drivers.errors import ProtocolError

DAY_MS = 86_400_000
_EPOCH_ORDINAL = date(1970, 1, 1).toordinal()
_TIME = re.compile(r"([01][0-9]|2[0-3])([0-5][0-9])([0-5][0-9]|60)(?:\.([0-9]*))?")


def time_of_day_ms(text: str) -> int | None:
    """Milliseconds of day of `hhmmss[.f]`, finer digits cut off; None when empty. ProtocolError when it is no time."""
    if not text:
        return None
    match = _TIME.fullmatch(text)
    if match is None or (match[3] == "60" and text[:4] != "2359"):
        raise ProtocolError(f"{text!r} is no time of day (hhmmss.ss)")
    seconds = int(match[1]) * 3600 + int(match[2]) * 60 + int(match[3])
    return seconds * 1000 + int(((match[4] or "") + "000")[:3])


def midnight_ms(day: str, month: str, year: str) -> int | None:
    """UTC midnight of a date in ms since 1970, two-digit years in 2000..2079.

    None when the fields are empty, or hold the year a receiver starts with (1980). ProtocolError when they are no date.
    """
    if not (day and month and year):
        return None
    try:
        number = int(year)
        if number < 100:
            number += 2000 if number < 80 else 1900
        ordinal = date(number, int(month), int(day)).toordinal()
    except ValueError as error:
        raise ProtocolError(f"{day!r}, {month!r}, {year!r} is no date") from error
    return (ordinal - _EPOCH_ORDINAL) * DAY_MS if number >= 2000 else None


def nearest_ms(time_ms: int, reference_ms: int) -> int:
    """UTC in ms since 1970 of a time of day, on the date that puts it within 12 h of the reference."""
    return time_ms + DAY_MS * round((reference_ms - time_ms) / DAY_MS)
