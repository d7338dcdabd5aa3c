"""What a detector says of one image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True, eq=False)
class FrameDetections:
    """Boxes in the pixels of the image as it came, none when nothing was found: that is evidence too.

    stamp_ns: exposure, in the time of the messages that came in. boxes_px: (n, 4) x_min, y_min, x_max, y_max as edges:
    the whole image is 0, 0, width, height, so the middle of its first pixel, (0, 0) of `CameraModel`, is at 0.5, 0.5.
    confidence: (n,) 0..1, descending. class_id: (n,) int64, index into `class_names`.
    """

    stamp_ns: int
    width_px: int
    height_px: int
    boxes_px: npt.NDArray[np.float64]
    confidence: npt.NDArray[np.float64]
    class_id: npt.NDArray[np.int64]
    class_names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.boxes_px)
