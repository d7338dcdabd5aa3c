"""The priority a process has in the field, also on a machine that other programs use."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

AUTOGROUP = Path("/proc/self/autogroup")


def claim(nice: int) -> None:
    """A session of its own at `nice`; what this user may not ask for stays as it is.

    Where the kernel groups processes by session (sched_autogroup_enabled), niceness counts within a group only, and
    the group has one of its own. systemd gives a service such a group anyway.
    """
    with contextlib.suppress(PermissionError):
        os.setsid()
    with contextlib.suppress(PermissionError):
        os.nice(nice)
    with contextlib.suppress(OSError):
        AUTOGROUP.write_text(str(nice))
