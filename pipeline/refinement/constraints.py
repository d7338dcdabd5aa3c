"""What the analyst knows better, in a TOML file. Times are seconds since the first pose, as the page shows them."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from pipeline.gnss.geodesy import Datum
from pipeline.refinement.errors import ConstraintsRefused

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Positive = Annotated[float, msgspec.Meta(gt=0)]
_SAME_S = 1.0
_CONTRADICTED = 5.0
"""Sigmas between two pins of one moment."""


class Pair(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`[[accept]]` or `[[forbid]]`: the candidate between the submaps that were walked at these times."""

    a_s: float
    b_s: float


class Guess(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`[[closure]]`: at a_s and b_s the carrier was at the same place; b as seen from a, ahead, left, up, and turned
    counter-clockwise. It is where registration begins, and verified as any other."""

    a_s: float
    b_s: float
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    yaw_deg: float = 0.0


class Stretch(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`[[drop_gnss]]`: no fix of this time is used."""

    from_s: float
    to_s: float


class Pin(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`[[pin]]`: a surveyed point, WGS 84, height above the ellipsoid, that was at `arm_m` in `base_link` then."""

    at_s: float
    latitude_deg: float
    longitude_deg: float
    height_m: float
    sigma_m: Positive = 0.05
    arm_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Constraints(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file."""

    accept: tuple[Pair, ...] = ()
    forbid: tuple[Pair, ...] = ()
    closure: tuple[Guess, ...] = ()
    drop_gnss: tuple[Stretch, ...] = ()
    pin: tuple[Pin, ...] = ()

    def times_s(self) -> Iterable[float]:
        """All that are named."""
        for pair in (*self.accept, *self.forbid):
            yield from (pair.a_s, pair.b_s)
        for guess in self.closure:
            yield from (guess.a_s, guess.b_s)
        for stretch in self.drop_gnss:
            yield from (stretch.from_s, stretch.to_s)
        for pin in self.pin:
            yield pin.at_s


def read_constraints(path: Path) -> Constraints:
    """ConstraintsRefused with file and key for what cannot be read."""
    try:
        return msgspec.convert(tomllib.loads(path.read_text(encoding="utf-8")), Constraints)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise ConstraintsRefused(f"{path}: {error}; docs/refinement.md has every key with an example") from error


def check(constraints: Constraints, duration_s: float) -> None:
    """ConstraintsRefused where they contradict each other, or speak of another time than the session's."""
    for second in constraints.times_s():
        if not 0.0 <= second <= duration_s:
            raise ConstraintsRefused(f"a constraint at {second:g} s: the session lasts from 0 to {duration_s:.1f} s")
    for stretch in constraints.drop_gnss:
        if stretch.from_s >= stretch.to_s:
            raise ConstraintsRefused(
                f"drop_gnss from {stretch.from_s:g} s to {stretch.to_s:g} s: ends before it begins"
            )
    both = {(pair.a_s, pair.b_s) for pair in constraints.accept} & {(pair.a_s, pair.b_s) for pair in constraints.forbid}
    if both:
        raise ConstraintsRefused(
            f"the closure between {min(both)[0]:g} s and {min(both)[1]:g} s: accepted and forbidden"
        )
    _check_pins(constraints.pin)


def _check_pins(pins: tuple[Pin, ...]) -> None:

    for k, one in enumerate(pins):
        datum = Datum(one.latitude_deg, one.longitude_deg, one.height_m)
        for other in pins[:k]:
            apart_m = float(np.linalg.norm(datum.enu(other.latitude_deg, other.longitude_deg, other.height_m)))
            allowed_m = _CONTRADICTED * (one.sigma_m + other.sigma_m)
            if abs(one.at_s - other.at_s) < _SAME_S and one.arm_m == other.arm_m and apart_m > allowed_m:
                raise ConstraintsRefused(
                    f"two pins at {other.at_s:g} s and {one.at_s:g} s are {apart_m:.2f} m apart, more than their "
                    f"sigmas allow: one of them is wrong"
                )
