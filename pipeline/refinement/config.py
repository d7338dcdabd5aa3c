"""What the refinement assumes. The rows of the benchmark are settings of it."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]
Kernel = Literal["huber", "cauchy", "geman-mcclure", "tukey", "welsch", "squared"]


class ChainConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Keyframes, and how far the odometry is believed from one to the next."""

    keyframe_m: Positive = 2.0
    keyframe_turn_deg: Positive = 45.0
    drift_scales: tuple[Positive, ...] = (1.0, 2.0, 4.0, 8.0, 16.0)
    """By which the drift that the odometry tells of is multiplied; the one that explains the fixes best is taken."""
    floor_m: Positive = 0.004
    """Drift after one metre that is taken at least, growing with the root of the way; `floor_turn_deg` likewise."""
    floor_turn_deg: Positive = 0.01
    level_deg: Positive = 2.0
    """How well each keyframe tells what is level. They err together, by 0.3 degrees for a hundred metres: fifty of them
    know no more than one would."""


class GnssConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Fixes as factors. Antenna, floors, spacing and duration of errors are those of `[fusion]`."""

    kernel: Kernel = "huber"
    width: Positive = 1.0
    """Of the kernel, in units of the one that keeps 95 % of the efficiency: 1.345 sigmas of Huber's."""
    gate: NotNegative = 13.8
    """Chi-square of a horizontal residual from which on a fix is left out; vertically 0.78 of it; 0: no gate."""
    learn: bool = True
    """Sigmas of a kind of fix are widened until their residuals are what they should be."""
    rounds: Annotated[int, msgspec.Meta(ge=1, le=20)] = 6
    """Of judging the fixes by the trajectory and the trajectory by the fixes, at most."""


class ClosureConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Places that were passed twice."""

    enabled: bool = True
    apart_m: Positive = 30.0
    """Of way between two submaps: closer ones the odometry has in one map anyway."""
    reach_m: Positive = 12.0
    """Submaps whose middles are closer than this see the same trees; uncertainty is added."""
    most_m: Positive = 30.0
    """Candidates farther apart than that are not looked at, however uncertain the way."""
    each: Annotated[int, msgspec.Meta(ge=1)] = 3
    """Candidates a submap, the nearest ones."""
    inlier_m: Positive = 0.35
    """A point that has another one so close in the other submap is met."""
    least_overlap: Positive = 0.5
    """Share of a submap's points that must be met."""
    rival_m: Positive = 0.6
    """A second pose farther than this from the first, and nearly as good, makes a place ambiguous."""
    rival_share: Positive = 0.93
    """Of the first one's overlap."""
    tilt_deg: Positive = 2.0
    """Gravity tells roll and pitch: a registration that tilts by more is wrong."""
    surprise: Positive = 16.8
    """Chi-square (99 % of six degrees of freedom) up to which a correction is what the trajectory allows."""
    sigma_m: Positive = 0.03
    sigma_deg: Positive = 0.15
    """Of a good registration; along a direction that the submaps hardly show, more."""
    weak_m: Positive = 0.10
    weak_deg: Positive = 0.5
    """A registration less certain than that along any direction is degenerate."""


class RecognitionConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Places known again by their stems, where the trajectory does not bring them near each other by itself."""

    enabled: bool = True
    met_m: Positive = 0.4
    """A stem that has another one so close is met."""
    least_stems: Annotated[int, msgspec.Meta(ge=4)] = 8
    least_nats: Positive = 12.0
    """Of the stems met, against as many met by chance: of all poses of all places, one is good by chance."""
    rival_m: Positive = 1.0
    rival_deg: Positive = 8.0
    """A pose farther than that from the best one is another answer."""
    rival_share: Positive = 0.75
    """Of the share of stems that the best one meets: another answer that meets as much makes the place ambiguous."""
    each: Annotated[int, msgspec.Meta(ge=1)] = 2
    """Proposals a submap, the best ones."""

    @property
    def rival_rad(self) -> float:
        """As radians."""
        return math.radians(self.rival_deg)


class MovingConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What moved, taken out of the map."""

    enabled: bool = True
    stays_s: Positive = 2.0
    """In a cell of 0.1 m, at most."""
    apart_s: Positive = 0.5
    """Rays so long before or after tell what was there at another time."""
    rays: Annotated[int, msgspec.Meta(ge=1)] = 6
    moments: Annotated[int, msgspec.Meta(ge=1)] = 3
    """So many of them, at so many different times, must have passed a cell; and no more than hit it in between."""
    least_cells: Annotated[int, msgspec.Meta(ge=1)] = 20
    least_height_m: Positive = 0.5
    """Such cells that touch make something that moved if there are as many, and it is so high."""


class RefinementConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All of it."""

    chain: ChainConfig = ChainConfig()
    gnss: GnssConfig = GnssConfig()
    closures: ClosureConfig = ClosureConfig()
    recognition: RecognitionConfig = RecognitionConfig()
    moving: MovingConfig = MovingConfig()
