"""What the analyst knows better, in a TOML file. Times are seconds since the first pose, as the page shows them.

Where several sessions are refined together, each time says whose it is: `a` and `b` beside `a_s` and `b_s`, `session`
beside all others.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
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
    a: str = ""
    b: str = ""


class Guess(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`[[closure]]`: at a_s and b_s the carrier was at the same place; b as seen from a, ahead, left, up, and turned
    counter-clockwise. It is where registration begins, and verified as any other."""

    a_s: float
    b_s: float
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    yaw_deg: float = 0.0
    a: str = ""
    b: str = ""


class Stretch(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`[[drop_gnss]]`: no fix of this time is used."""

    from_s: float
    to_s: float
    session: str = ""


class Pin(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`[[pin]]`: a surveyed point, WGS 84, height above the ellipsoid, that was at `arm_m` in `base_link` then."""

    at_s: float
    latitude_deg: float
    longitude_deg: float
    height_m: float
    sigma_m: Positive = 0.05
    arm_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    session: str = ""


class Constraints(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file."""

    accept: tuple[Pair, ...] = ()
    forbid: tuple[Pair, ...] = ()
    closure: tuple[Guess, ...] = ()
    drop_gnss: tuple[Stretch, ...] = ()
    pin: tuple[Pin, ...] = ()

    def times_s(self) -> Iterable[tuple[str, float]]:
        """All that are named: session, seconds."""
        pairs: list[Pair | Guess] = [*self.accept, *self.forbid, *self.closure]
        for pair in pairs:
            yield from ((pair.a, pair.a_s), (pair.b, pair.b_s))
        for stretch in self.drop_gnss:
            yield from ((stretch.session, stretch.from_s), (stretch.session, stretch.to_s))
        for pin in self.pin:
            yield pin.session, pin.at_s

    def about(self, names: set[str]) -> Constraints:
        """What concerns these sessions and no other. Nothing is taken away that names no session."""
        known = names | {""}
        return Constraints(
            tuple(one for one in self.accept if {one.a, one.b} <= known),
            tuple(one for one in self.forbid if {one.a, one.b} <= known),
            tuple(one for one in self.closure if {one.a, one.b} <= known),
            tuple(one for one in self.drop_gnss if one.session in known),
            tuple(one for one in self.pin if one.session in known),
        )


def number_of(name: str, names: Sequence[str]) -> int:
    """Which session is meant: the only one, where no name is given."""
    return list(names).index(name) if name else 0


def read_constraints(path: Path) -> Constraints:
    """ConstraintsRefused with file and key for what cannot be read."""
    try:
        return msgspec.convert(tomllib.loads(path.read_text(encoding="utf-8")), Constraints)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise ConstraintsRefused(f"{path}: {error}; docs/refinement.md has every key with an example") from error


def check(constraints: Constraints, durations_s: Mapping[str, float]) -> None:
    """ConstraintsRefused where they contradict each other, or speak of other sessions or times than there are.

    durations_s: of each session, by name.
    """
    for name, second in constraints.times_s():
        duration_s = _duration_s(name, durations_s)
        if not 0.0 <= second <= duration_s:
            raise ConstraintsRefused(
                f"a constraint at {second:g} s: {name or 'the session'} lasts from 0 to {duration_s:.1f} s"
            )
    for stretch in constraints.drop_gnss:
        if stretch.from_s >= stretch.to_s:
            raise ConstraintsRefused(
                f"drop_gnss from {stretch.from_s:g} s to {stretch.to_s:g} s: ends before it begins"
            )
    both = {_ends(pair) for pair in constraints.accept} & {_ends(pair) for pair in constraints.forbid}
    if both:
        (a, a_s), (b, b_s) = min(both)
        raise ConstraintsRefused(
            f"the closure between {a} {a_s:g} s and {b} {b_s:g} s: accepted and forbidden".replace("  ", " ")
        )
    _check_pins(constraints.pin)


def _duration_s(name: str, durations_s: Mapping[str, float]) -> float:
    if not name and len(durations_s) == 1:
        return next(iter(durations_s.values()))
    if name not in durations_s:
        known, said = ", ".join(durations_s), f"of session {name!r}" if name else "that names no session"
        raise ConstraintsRefused(f"a constraint {said}: there are {known}")
    return durations_s[name]


def _ends(pair: Pair) -> tuple[tuple[str, float], tuple[str, float]]:
    a, b = sorted(((pair.a, pair.a_s), (pair.b, pair.b_s)))
    return a, b


def _check_pins(pins: tuple[Pin, ...]) -> None:
    for k, one in enumerate(pins):
        datum = Datum(one.latitude_deg, one.longitude_deg, one.height_m)
        for other in pins[:k]:
            apart_m = float(np.linalg.norm(datum.enu(other.latitude_deg, other.longitude_deg, other.height_m)))
            allowed_m = _CONTRADICTED * (one.sigma_m + other.sigma_m)
            together = one.session == other.session and abs(one.at_s - other.at_s) < _SAME_S
            if together and one.arm_m == other.arm_m and apart_m > allowed_m:
                raise ConstraintsRefused(
                    f"two pins at {other.at_s:g} s and {one.at_s:g} s are {apart_m:.2f} m apart, more than their "
                    f"sigmas allow: one of them is wrong"
                )
