"""What the alignment can be told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Lobe = Literal["positive", "absolute"]
Method = Literal["joint", "nmi"]


@dataclass(frozen=True, slots=True)
class AlignmentConfig:
    """Defaults hold for airborne scans of 5 points a square metre and more."""

    search_m: float = 10.0
    """Greatest shift, along each axis, from where the terrestrial map was put."""
    search_deg: float = 35.0
    """Greatest turn to either side."""
    cell_m: float = 0.5
    method: Method = "joint"
    """`nmi` is the published one, on stems and crown tops alone."""
    lobe: Lobe = "positive"
    """`absolute` rewards gaps as much as crowns: equation 2 as printed."""
    log_scales_m: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0)
    kernel_m: float = 1.0
    """Bandwidth of the stem density (equation 3)."""
    bins: int = 16
    overlap: float = 0.85
    """Share of the terrestrial footprint that has to lie on the aerial map; less between terrestrial sessions."""
    rival_m: float = 2.0
    """A pose farther away than this, or than `rival_deg`, is another answer."""
    rival_deg: float = 6.0
    margin_nats: float = 6.0
    """Least log-likelihood ratio to the best other answer: 6 is odds of four hundred to one, were the model true. It is
    asked for in units of what wrong answers lie apart among themselves, if that is more than a nat."""
    least_stems: int = 12
    device: str = "cpu"
    """Where candidate poses are scored; `cuda` takes PyTorch and a GPU."""
    crown_bias_m: float = 0.5
    """Crowns do not stand above their stems: sigma of that as an offset common to a plot, where only stems tell."""
