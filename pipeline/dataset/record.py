"""One image of a dataset: a line of `manifest.jsonl`."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

Source = Literal["field", "inaturalist", "other"]
Split = Literal["", "train", "val", "test", "gap"]
SPLITS: tuple[Split, ...] = ("train", "val", "test")
Pixels = Annotated[int, msgspec.Meta(gt=0)]
GAP: Split = "gap"
"""Labelled, and in no split: too near to an image of another one."""


class ImageRecord(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """image: the file's name in `images/`; its labels are `labels/<stem>.txt`, absent until somebody looked at it."""

    image: str
    sha256: str
    width_px: Pixels
    height_px: Pixels
    source: Source = "other"
    site: str = ""
    session: str = ""
    stamp_ns: int | None = None
    """UTC: session time of a recording, or when a photo was taken."""
    travelled_m: float | None = None
    """Along the way of the session."""
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    height_m: float | None = None
    """WGS 84, above the ellipsoid; of `base_link` for images of a recording."""
    obscured: bool = False
    """The position was blurred by who published it, by up to some 20 km."""
    sharpness: float | None = None
    phash: Annotated[str, msgspec.Meta(pattern="^([0-9a-f]{16})?$")] = ""
    """Perceptual hash, 16 hexadecimal digits."""
    jpeg_quality: int | None = None
    chosen_by: str = ""
    """distance or time."""
    group: str = ""
    """Images of one group belong together: an observation."""
    taxon: str = ""
    """What the observers say it is."""
    split: Split = ""
    licence: str = ""
    attribution: str = ""
    non_commercial: bool = False
    url: str = ""

    @property
    def stem(self) -> str:
        """What the image and its labels have in common."""
        return self.image.rpartition(".")[0] or self.image

    @property
    def placed(self) -> bool:
        """Whether the position says where it is."""
        return self.latitude_deg is not None and self.longitude_deg is not None and not self.obscured
