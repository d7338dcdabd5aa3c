"""What the inventory assumes of stems and of the scanner."""

from __future__ import annotations

from typing import Annotated

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]


class Scanner(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Of the LiDAR that made the map; the defaults are the Mid-360's. Sigmas are of one return."""

    range_sigma_m: NotNegative = 0.008
    range_growth: NotNegative = 0.0004
    """Metres of range sigma a metre of range."""
    beam_rad: NotNegative = 0.0018
    """Sigma across the beam, a radian: pointing noise and half the divergence. It is what inflates small stems."""
    rim_m: Positive = 0.003
    rim_growth: NotNegative = 0.0026
    """From the edge of a stem inwards, a beam is partly beside it: so wide, and as much more a metre of range."""
    rim_loss: Annotated[float, msgspec.Meta(ge=0, le=0.9)] = 0.4
    """Share of the returns there that the sensor tags as glued to what is behind, and that our maps leave out."""


class InventoryConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Lengths in metres, heights above the ground."""

    lowest_m: Positive = 1.0
    highest_m: Positive = 6.0
    """Stems are looked for between these: undergrowth below, crowns above."""
    least_dbh_m: Positive = 0.05
    most_dbh_m: Positive = 1.5
    least_length_m: Positive = 1.5
    """Of stem that circles were found on, from the lowest to the highest."""
    least_slices: Annotated[int, msgspec.Meta(ge=2)] = 4
    least_arc_deg: Positive = 70.0
    """Of the bark; below, a circle says more about noise than about the stem."""
    most_lean_deg: Positive = 25.0
    terrain_cell_m: Positive = 0.5
    steepest: Positive = 1.2
    """Rise over run of the ground, at most."""
    canopy_cell_m: Positive = 0.5
    block_m: Positive = 32.0
    """Side of what is worked on at a time."""
    scanner: Scanner = Scanner()
