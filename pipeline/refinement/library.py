"""GTSAM, or a word about where it comes from."""

from __future__ import annotations

from pipeline.refinement.errors import LibraryMissing

try:
    import gtsam
except ImportError as error:
    raise LibraryMissing(
        f"GTSAM cannot be loaded ({error}): install mapforest with the extra `refine`, on Python 3.11 or later"
    ) from error

__all__ = ["gtsam"]
