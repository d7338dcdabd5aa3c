"""Surveyed points that the carrier held, as the graph takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.estimates import Array
from pipeline.gnss.geodesy import Datum
from pipeline.refinement.constraints import Pin
from pipeline.refinement.errors import ConstraintsRefused
from pipeline.refinement.keyframes import Keyframes


@dataclass(frozen=True, slots=True, eq=False)
class Pinned:
    """position_m: (3,) in `map`. arm_m: (3,) of the point in the body of the keyframe."""

    keyframe: int
    position_m: Array
    arm_m: Array
    sigma_m: float


def place_pins(
    track: npt.NDArray[np.void], frames: Keyframes, pins: Sequence[Pin], datum: Datum | None
) -> list[Pinned]:
    """ConstraintsRefused where there is no `map` to pin anything in."""
    if pins and datum is None:
        raise ConstraintsRefused(
            "a pin needs a session that GNSS can place: this one has no fixes that tell its heading"
        )
    placed = []
    for pin in pins:
        assert datum is not None
        stamp = int(track["stamp_ns"][0]) + round(pin.at_s * 1e9)
        record = track[min(int(np.searchsorted(track["stamp_ns"], stamp)), len(track) - 1)]
        key = int(frames.nearest(record["stamp_ns"][None])[0])
        held_m = record["position_m"] + record["rotation"] @ np.array(pin.arm_m)
        arm_m = frames.rotations[key].T @ (held_m - frames.positions_m[key])
        place = datum.enu(pin.latitude_deg, pin.longitude_deg, pin.height_m)
        placed.append(Pinned(key, place, arm_m, pin.sigma_m))
    return placed
