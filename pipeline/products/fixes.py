"""Every GNSS fix of a session as a table, and back."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

from drivers.messages import FixQuality, GnssFix

HEADER = (
    "time_s,quality,latitude_deg,longitude_deg,height_m,geoid_separation_m,satellites,hdop,age_s,sigma_east_m,"
    "sigma_north_m,sigma_up_m,sigma_source"
)
"""height_m: above the WGS 84 ellipsoid. quality: GGA field 6. Empty: not known."""


def write_fixes(path: Path, fixes: Sequence[GnssFix]) -> None:
    """A line a fix, in order of arrival."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADER.split(","))
        for fix in fixes:
            seconds, rest = divmod(fix.stamp_ns, 1_000_000_000)
            place = (_text(fix.latitude_deg, 9), _text(fix.longitude_deg, 9), _text(fix.height_m, 4))
            state = (_text(fix.geoid_separation_m, 3), fix.satellites, _text(fix.hdop, 2), _text(fix.age_s, 2))
            sigma = (_text(value, 4) for value in fix.sigma_enu_m)
            writer.writerow([f"{seconds}.{rest:09d}", int(fix.quality), *place, *state, *sigma, fix.sigma_source])


def read_fixes(path: Path) -> list[GnssFix]:
    """What was written; the time of arrival is not in it. ValueError for another table."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    if not rows or rows[0] != HEADER.split(","):
        raise ValueError(f"{path}: not a table of fixes of this version; process the recording again")
    return [_fix(row) for row in rows[1:]]


def _fix(row: list[str]) -> GnssFix:
    stamp_ns = int(row[0].replace(".", ""))
    latitude, longitude, height, separation = map(_number, row[2:6])
    east, north, up = map(_number, row[9:12])
    return GnssFix(
        stamp_ns=stamp_ns,
        receive_ns=stamp_ns,
        utc_ns=0,
        date_assumed=True,
        quality=FixQuality(int(row[1])),
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        geoid_separation_m=separation,
        satellites=int(row[6]),
        hdop=_number(row[7]),
        age_s=float(row[8]) if row[8] else None,
        sigma_enu_m=(east, north, up),
        sigma_source=row[12],
    )


def _text(value: float | None, digits: int) -> str:
    return "" if value is None or not math.isfinite(value) else f"{value:.{digits}f}"


def _number(text: str) -> float:
    return float(text) if text else math.nan
