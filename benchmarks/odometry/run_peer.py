"""One peer over one walk, in the peer's own environment. Needs numpy and the peer, nothing of this project.

    python run_peer.py PEER INPUT.npz OUTPUT.npz THREADS

INPUT: xyz (n, 3) float32, offset_s (n,) float32, ends (scans,), scan_s (scans,) start of each sweep, imu (m, 7) time,
rate, force; lever (3,). OUTPUT: stamps_s (k,), position (k, 3) and rotation (k, 3, 3) of `base_link`, ms (k,), peak_mb,
failed (a text, empty when it ended).
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

SWEEP_S = 0.1
REST_SCANS = 10


def main() -> None:
    peer, source, target = sys.argv[1:4]
    threads = int(sys.argv[4])
    data = dict(np.load(source))
    failed = ""
    rows: list[tuple[float, np.ndarray, float]] = []
    try:
        for row in PEERS[peer](data, threads):
            rows.append(row)
    except Exception as error:
        failed = f"{type(error).__name__}: {error}"
    poses = np.array([pose for _, pose, _ in rows]).reshape(-1, 4, 4)
    # Not `getrusage`: that remembers the parent's size from before the exec.
    peak_mb = int(Path("/proc/self/status").read_text(encoding="ascii").split("VmHWM:")[1].split()[0]) / 1024.0
    peak_mb -= sum(array.nbytes for array in data.values()) / 2**20  # its input, which a payload would not hold
    numbers = {"stamps_s": [row[0] for row in rows], "ms": [row[2] for row in rows], "peak_mb": peak_mb}
    np.savez(target, position=poses[:, :3, 3], rotation=poses[:, :3, :3], failed=failed, **numbers)


def _sweeps(data):
    first = 0
    for k, last in enumerate(data["ends"]):
        yield float(data["scan_s"][k]), data["xyz"][first:last].astype(np.float64), data["offset_s"][first:last]
        first = last


def _rko(data, **settings):
    from rko_lio.lio import LIO, LIOConfig

    lio = LIO(LIOConfig(**settings))
    extrinsic = np.eye(4)
    extrinsic[:3, 3] = data["lever"]
    imu, used = data["imu"], 0
    for start, xyz, offset in _sweeps(data):
        end = start + SWEEP_S
        begun = time.process_time()
        while used < len(imu) and imu[used, 0] <= end + 1e-6:
            lio.add_imu_measurement(imu[used, 4:7], imu[used, 1:4], round(imu[used, 0] * 1e9))
            used += 1
        stamps = np.round((start + offset.astype(np.float64)) * 1e9).astype(np.int64)
        lio.register_scan(xyz, stamps, extrinsic_lidar2base=extrinsic)
        took = 1e3 * (time.process_time() - begun)
        times, poses = lio.poses_with_timestamps()
        if len(times):
            yield float(times[-1]) * 1e-9, _pose(*np.split(np.asarray(poses[-1]), [3])), took


def rko(data, threads):
    return _rko(data, max_num_threads=threads, initialization_phase=True)


def rko_fine(data, threads):
    fine = {"voxel_size": 0.5, "double_downsample": False, "max_correspondence_distance": 0.3}
    return _rko(data, max_num_threads=threads, initialization_phase=True, **fine)


def genz(data, threads):
    import genz_lio
    from genz_lio import GenZLIO, load_config

    config = load_config(str(Path(genz_lio.__file__).parent / "configs/default/mid360.yaml"))
    config.max_threads = threads
    config.mapping.extrinsic_t = data["lever"]
    lio = GenZLIO(config)
    imu, used = data["imu"], 0
    for start, xyz, offset in _sweeps(data):
        end = start + SWEEP_S
        until = int(np.searchsorted(imu[:, 0], end + 1e-6))
        part, used = imu[used:until], until
        rows = np.column_stack([part[:, 0], part[:, 4:7], part[:, 1:4]])
        begun = time.process_time()
        result = lio.register_scan(xyz, start, end, rows, timestamps=offset.astype(np.float64))
        took = 1e3 * (time.process_time() - begun)
        yield end, np.asarray(result.pose), took


def kiss(data, threads):
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig()
    config.mapping.voxel_size = 1.0
    config.registration.max_num_threads = threads
    odometry = KissICP(config)
    for start, xyz, offset in _sweeps(data):
        begun = time.process_time()
        odometry.register_frame(xyz, offset / SWEEP_S)
        took = 1e3 * (time.process_time() - begun)
        yield start + 0.5 * SWEEP_S, _of_base(odometry.last_pose, data["lever"]), took


def kiss_slam(data, threads):
    from kiss_slam.config import load_config
    from kiss_slam.slam import KissSLAM

    config = load_config(None)
    config.odometry.registration.max_num_threads = threads
    config.local_mapper.splitting_distance = 30.0  # as the crow flies; by default 100 m, and short walks have no loops
    slam, rows = KissSLAM(config), []
    for start, xyz, offset in _sweeps(data):
        begun = time.process_time()
        slam.process_scan(xyz, offset / SWEEP_S)
        rows.append((start + 0.5 * SWEEP_S, 1e3 * (time.process_time() - begun)))
    begun = time.process_time()
    slam.generate_new_node()
    slam.local_map_graph.erase_last_local_map()
    poses, _ = slam.fine_grained_optimization()
    at_the_end = 1e3 * (time.process_time() - begun) / len(rows)
    print(f"{len(slam.get_closures())} closures", flush=True)
    for (stamp, took), pose in zip(rows, poses, strict=True):
        yield stamp, _of_base(pose, data["lever"]), took + at_the_end


def _of_base(pose, lever):
    """From the pose of the sensor, which is at mid-sweep; both have the same axes."""
    moved = np.array(pose)
    moved[:3, 3] -= moved[:3, :3] @ lever
    return moved


def _pose(place, quaternion):
    """quaternion: x y z w."""
    pose, (x, y, z, w) = np.eye(4), quaternion / np.linalg.norm(quaternion)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose[:3, :3] += 2.0 * (w * cross + cross @ cross)
    pose[:3, 3] = place
    return pose


PEERS = {"rko_lio": rko, "rko_lio_fine": rko_fine, "genz_lio": genz, "kiss_icp": kiss, "kiss_slam": kiss_slam}

if __name__ == "__main__":
    main()
