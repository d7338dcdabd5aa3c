"""The computer: time, kernel limits, permissions."""

from __future__ import annotations

import grp
import os
import shutil
from pathlib import Path

from edge.config import Config
from edge.preflight.check import Check, Outcome

RECEIVE_BUFFER_BYTES = 4 * 1024 * 1024
SANE_EPOCH_S = 1_767_225_600
"""2026-01-01: a clock before that was never set since power-on."""


def check_kernel(proc: Path = Path("/proc")) -> Check:
    """The limit on socket buffers, without which the LiDAR's datagrams are lost when the machine is busy."""
    limit = int((proc / "sys/net/core/rmem_max").read_text())
    found = f"socket buffers up to {limit // 1024} KiB"
    if limit >= RECEIVE_BUFFER_BYTES:
        return Check("kernel", Outcome.GOOD, found)
    return Check("kernel", Outcome.WARNING, found, "sudo sysctl net.core.rmem_max=16777216 (the installer sets it)")


def check_clock(now_s: float, synchronised: bool, source: str) -> Check:
    """Recordings are named and georeferenced by UTC; a late synchronisation is recorded, a wrong year is not mended."""
    if now_s < SANE_EPOCH_S:
        return Check("clock", Outcome.BAD, "this computer's date was never set", "connect it to time (GNSS, network)")
    if synchronised:
        return Check("clock", Outcome.GOOD, f"synchronised ({source})")
    advice = "fine under trees: sensors are still aligned with each other; UTC may be off by seconds"
    return Check("clock", Outcome.WARNING, "not synchronised", advice)


def check_permissions(config: Config) -> list[Check]:
    """Serial ports need a group; asked only where a receiver is on one."""
    serial = [name for name, table in config.sensors.items() if str(table.get("endpoint", "")).startswith("serial:")]
    if not serial or os.getuid() == 0:
        return []
    groups = {grp.getgrgid(gid).gr_name for gid in os.getgroups()}
    if "dialout" in groups:
        return [Check("permissions", Outcome.GOOD, "this user may open serial ports")]
    advice = "sudo usermod -aG dialout $USER, then log in again"
    return [Check("permissions", Outcome.BAD, f"this user may not open serial ports (for {', '.join(serial)})", advice)]


def check_programs() -> Check:
    """Tools that a session does not need, and an operator likes to have."""
    missing = [tool for tool in ("tmux",) if shutil.which(tool) is None]
    if not missing:
        return Check("tools", Outcome.GOOD, "tmux is there: the screen survives a lost SSH link")
    return Check("tools", Outcome.WARNING, "no tmux", "apt install tmux: the screen then survives a lost SSH link")
