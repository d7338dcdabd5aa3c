"""What the grounding assumes of detector, camera and forest."""

from __future__ import annotations

import msgspec


class EvidenceConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How much one view says of one tree. Shares are of views in which it stands unhidden."""

    recall_near: float = 0.65
    """Of the detector within `near_m`; from there it falls to `recall_far` at the farthest range that counts."""
    recall_far: float = 0.4
    near_m: float = 8.0
    false_share: float = 0.04
    """Views in which something else that stands there is taken for the target."""
    prior: float = 0.05
    """Probability that a stem of the map is of the target kind, before any box."""
    prior_free: float = 0.01
    """The same of a place that a box points at where no stem is; often it is another one's box, misplaced."""
    fresh_m: float = 1.0
    """Views from places closer to each other than this see the same again, and count as a part of one."""
    least_fresh: float = 0.02
    most_log_odds: float = 8.0


class GroundingConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Lengths in metres, in the frame of the odometry."""

    target: str = ""
    """Class of the model that is mapped; empty: its first."""
    nearest_m: float = 1.0
    farthest_m: float = 18.0
    """Beyond, a view says nothing, neither for nor against."""
    cell_px: int = 4
    """Of the depth image, at 848 pixels across; other sizes in proportion."""
    splat_m: float = 0.15
    """A LiDAR point hides what is behind it over this much."""
    behind_m: float = 0.4
    """A point this far behind the first one in its cell is still seen; and 2 % of the range."""
    near_side_m: float = 0.5
    """What is seen of a tree is its near side: so much before the stem, for a crown more than for a stem, ..."""
    range_sigma_m: float = 1.2
    """... give or take."""
    box_sigma: float = 0.12
    """Of the stem's place across the box, as a share of its width."""
    hidden: float = 4.0
    """Most chi-square that a known target adds for standing behind the range seen: something hides a part of it."""
    gate: float = 9.2
    """Chi-square of two degrees of freedom, 99 %."""
    stem_m: float = 0.35
    """A stem found again is the same within this."""
    covered: float = 0.35
    """Share of a miss that counts for a tree that another one's box covers: both may have been taken for one."""
    voxel_m: float = 0.3
    """Of the evidence by point."""
    probable: float = 0.5
    """From here on a tree is handed out as a finding."""
    views_kept: int = 5
    """Images kept of each tree."""
    evidence: EvidenceConfig = EvidenceConfig()
