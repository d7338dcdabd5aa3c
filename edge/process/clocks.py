"""Whether what a recording holds is of one time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from edge.words import duration

Stamps = npt.NDArray[np.int64]


def apart(stamps_ns: Stamps, poses_ns: Stamps) -> str:
    """How far stamps lie from the poses of a session, in words; empty where any of them lies among the poses."""
    if not len(stamps_ns) or not len(poses_ns):
        return ""
    if np.any((stamps_ns >= poses_ns[0]) & (stamps_ns <= poses_ns[-1])):
        return ""
    early_ns, late_ns = int(poses_ns[0] - stamps_ns.max()), int(stamps_ns.min() - poses_ns[-1])
    which = "after the last" if late_ns > early_ns else "before the first"
    by = duration(max(late_ns, early_ns) / 1e9)
    off_s = int(np.median(stamps_ns) - np.median(poses_ns)) / 1e9
    return f"all {len(stamps_ns)} are stamped {by} {which} pose: two clocks disagree, by {off_s:+.0f} s or so"
