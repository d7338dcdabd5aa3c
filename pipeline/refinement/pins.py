"""Surveyed points that the carrier held, as the graph takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimates import Array
from pipeline.gnss.geodesy import Datum
from pipeline.refinement.constraints import Pin, number_of
from pipeline.refinement.errors import ConstraintsRefused
from pipeline.refinement.keyframes import Keyframes, Poses
from pipeline.refinement.session import Session


@dataclass(frozen=True, slots=True, eq=False)
class Pinned:
    """position_m: (3,) in `map`. arm_m: (3,) of the point in the body of the keyframe. at: when, in words."""

    keyframe: int
    position_m: Array
    arm_m: Array
    sigma_m: float
    at: str

    def residual_m(self, poses: Poses) -> float:
        """By how much the trajectory misses it."""
        held_m = poses.positions_m[self.keyframe] + poses.rotations[self.keyframe] @ self.arm_m
        return float(np.linalg.norm(held_m - self.position_m))


def place_pins(
    sessions: Sequence[Session], frames: Keyframes, pins: Sequence[Pin], datum: Datum | None
) -> list[Pinned]:
    """ConstraintsRefused where there is no `map` to pin anything in."""
    if pins and datum is None:
        raise ConstraintsRefused(
            "a pin needs a session that GNSS can place: this one has no fixes that tell its heading"
        )
    placed = []
    for pin in pins:
        assert datum is not None
        number = number_of(pin.session, [session.name for session in sessions])
        track = sessions[number].track
        stamp = int(track["stamp_ns"][0]) + round(pin.at_s * 1e9)
        record = track[min(int(np.searchsorted(track["stamp_ns"], stamp)), len(track) - 1)]
        key = int(frames.nearest(record["stamp_ns"][None], number)[0])
        held_m = record["position_m"] + record["rotation"] @ np.array(pin.arm_m)
        arm_m = frames.rotations[key].T @ (held_m - frames.positions_m[key])
        place = datum.enu(pin.latitude_deg, pin.longitude_deg, pin.height_m)
        at = f"{pin.at_s:g} s of {pin.session}" if pin.session else f"{pin.at_s:g} s"
        placed.append(Pinned(key, place, arm_m, pin.sigma_m, at))
    return placed
