"""The simulated camera: where it sits, how it projects, when it exposes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

FRAME_NUMERATOR, FRAME_DENOMINATOR = 1001, 30000
"""29.97 frames a second, the camera's own rational."""
PREVIEW_LATENCY_S = 0.12
"""From exposure to the first packet of the preview. A real HERO8 needs 0.5 s and more."""


def exposure_ns(index: int) -> int:
    """Walk time at which frame `index` is exposed."""
    return index * FRAME_NUMERATOR * 1_000_000_000 // FRAME_DENOMINATOR


def _optical_in_base() -> npt.NDArray[np.float64]:
    # x right, y down, z forward, as columns in base_link (x forward, y left, z up)
    return np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Pinhole without distortion (the camera's linear lens). Pose of the optical frame in `base_link`.

    position_m (3,), rotation (3, 3) optical to base. focal_px gives 89 degrees across 848 pixels.
    """

    width_px: int = 848
    height_px: int = 480
    focal_px: float = 432.0
    position_m: tuple[float, float, float] = (0.06, 0.0, -0.07)
    rotation: npt.NDArray[np.float64] = field(default_factory=_optical_in_base)

    @property
    def lens(self) -> npt.NDArray[np.float64]:
        """fx, fy, cx, cy in pixels."""
        return np.array([self.focal_px, self.focal_px, (self.width_px - 1) / 2.0, (self.height_px - 1) / 2.0])
