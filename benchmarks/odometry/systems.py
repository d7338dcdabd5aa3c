"""Ours and its peers, each run over a walk in a process of its own; a peer in an environment of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.odometry.simulated import EPOCH_NS, IMU_NS, LIDAR_IN_BASE_M, Walk

PEERS_START_S = 100.0


def run(one: Walk, system: str, target: Path, python: str, threads: int = 1) -> None:
    """Poses, times and memory into `target`; nothing but the reason where it failed."""
    count = str(threads)
    environment = os.environ | {"NUMBA_NUM_THREADS": count, "OMP_NUM_THREADS": count, "OPENBLAS_NUM_THREADS": "1"}
    if system == "ours":
        command = [sys.executable, "-m", "benchmarks.odometry.run_ours", str(one.folder), str(target)]
        command += [] if one.first_s is None else [str(one.first_s)]
    else:
        script = Path(__file__).with_name("run_peer.py")
        command = [python, str(script), system, str(exported(one)), str(target), count]
    ended = subprocess.run(command, env=environment, check=False, capture_output=True, text=True)
    if ended.returncode != 0:
        last = (ended.stderr.strip().splitlines() or [""])[-1]
        nothing = np.empty(0)
        empty = {"stamp_ns": nothing, "stamps_s": nothing, "position": np.empty((0, 3)), "ms": nothing, "peak_mb": 0.0}
        np.savez(target, failed=f"exit {ended.returncode}: {last}", **empty)


def exported(one: Walk) -> Path:
    """The walk as `run_peer.py` reads it."""
    path = one.folder / f"peer_input{one.part}.npz"
    if not path.exists():
        scans = list(one.scans())
        imu = np.load(one.folder / "imu.npy")
        np.savez(
            path,
            xyz=np.concatenate([scan.xyz_m for scan in scans]),
            offset_s=np.concatenate([scan.offset_ns * 1e-9 for scan in scans]).astype(np.float32),
            ends=np.cumsum([len(scan.xyz_m) for scan in scans]),
            scan_s=[_peer_s(scan.stamp_ns) for scan in scans],
            imu=np.column_stack([PEERS_START_S + np.arange(len(imu)) * IMU_NS * 1e-9, imu[:, :6]]),
            lever=np.array(LIDAR_IN_BASE_M),
        )
    return path


def stamps_ns(found: np.lib.npyio.NpzFile) -> npt.NDArray[np.int64]:
    """(k,) of the poses in a target, in the clock of the walk's scans."""
    if "stamp_ns" in found and len(found["stamp_ns"]):
        return np.asarray(found["stamp_ns"])
    return np.round((found["stamps_s"] - PEERS_START_S) * 1e9).astype(np.int64) + EPOCH_NS


def _peer_s(stamp_ns: int) -> float:
    return (stamp_ns - EPOCH_NS) * 1e-9 + PEERS_START_S
