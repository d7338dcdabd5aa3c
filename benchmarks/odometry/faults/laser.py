"""What can be wrong with the points: of the world, of the air, of the lens, of the mounting."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.odometry.faults.streams import SECOND_NS, Fault, Span, Streams, chosen, each_scan
from benchmarks.odometry.simulated import LIDAR_IN_BASE_M
from drivers.messages import LidarScan

PACKET_NS = 480_000
"""96 points, 5 us apart."""
PARTICLE_TAG = 0b0100
FARTHEST_GROUND_M = 30.0
WALKER_RADIUS_M, WALKER_TOP_M, WALKER_FOOT_M = 0.25, 0.45, -1.35
Array = np.ndarray


def walkers(paths: tuple[tuple[tuple[float, float], tuple[float, float]], ...]) -> Fault:
    """People as upright cylinders: place (m) and velocity (m/s) in the plane, as seen from the sensor at the begin."""

    def apply(streams: Streams, span: Span) -> Streams:
        def cross(scan: LidarScan) -> LidarScan:
            since_s = (scan.stamp_ns - span.begin_ns + scan.offset_ns.astype(np.float64)) / SECOND_NS
            xyz = scan.xyz_m
            for start, velocity in paths:
                xyz = _before(xyz, np.array(start) + since_s[:, None] * np.array(velocity))
            return replace(scan, xyz_m=xyz)

        return each_scan(streams, span, cross)

    return apply


def _before(xyz_m: Array, centre_m: Array) -> Array:
    """The points (n, 3), those behind a cylinder at centres (n, 2) moved to its surface."""
    distance = np.linalg.norm(xyz_m, axis=1)
    ray = xyz_m / np.maximum(distance, 1e-6)[:, None]
    level = np.maximum(np.linalg.norm(ray[:, :2], axis=1), 1e-6)
    along = (ray[:, :2] * centre_m).sum(axis=1) / level
    aside = np.square(centre_m).sum(axis=1) - along**2
    reach = (along - np.sqrt(np.maximum(WALKER_RADIUS_M**2 - aside, 0.0))) / level
    height = reach * ray[:, 2]
    met = (aside < WALKER_RADIUS_M**2) & (along > 0.0) & (reach > 0.1) & (reach < distance)
    met &= (height > WALKER_FOOT_M) & (height < WALKER_TOP_M)
    return np.where(met[:, None], reach[:, None] * ray, xyz_m).astype(np.float32)


def waving(amplitude_m: float, hz: float) -> Fault:
    """Wind: what is above the sensor sways, the more the higher, each tree in its own time."""

    def apply(streams: Streams, span: Span) -> Streams:
        def sway(scan: LidarScan) -> LidarScan:
            time_s = (scan.stamp_ns - span.begin_ns + scan.offset_ns.astype(np.float64)) / SECOND_NS
            x, y, z = scan.xyz_m.T
            share = np.clip(z / 5.0, 0.0, 1.0)
            phase = np.floor(x / 2.0) * 1.7 + np.floor(y / 2.0) * 2.9
            swing = amplitude_m * share * np.sin(2.0 * math.pi * hz * time_s + phase)
            moved = scan.xyz_m + np.column_stack([swing, 0.5 * swing, np.zeros_like(swing)])
            return replace(scan, xyz_m=moved.astype(np.float32))

        return each_scan(streams, span, sway)

    return apply


def particles(share: float, farthest_m: float, tagged: float) -> Fault:
    """Dust or rain: a share of the beams ends in the air, nearer ones the more; of these a share is tagged."""

    def apply(streams: Streams, span: Span) -> Streams:
        random = np.random.default_rng(11)

        def cloud(scan: LidarScan) -> LidarScan:
            count = len(scan.xyz_m)
            distance = np.linalg.norm(scan.xyz_m, axis=1)
            drop = 0.3 + (farthest_m - 0.3) * random.random(count) ** 2
            hit = (random.random(count) < share) & (drop < distance)
            scale = np.where(hit, drop / np.maximum(distance, 1e-6), 1.0)
            told = hit & (random.random(count) < tagged)
            tag = np.where(told, PARTICLE_TAG, scan.tag).astype(np.uint8)
            return replace(scan, xyz_m=(scan.xyz_m * scale[:, None]).astype(np.float32), tag=tag)

        return each_scan(streams, span, cloud)

    return apply


def lost_packets(share: float) -> Fault:
    """Datagrams of 96 points that never arrive."""

    def apply(streams: Streams, span: Span) -> Streams:
        random = np.random.default_rng(12)

        def lose(scan: LidarScan) -> LidarScan:
            packet = scan.offset_ns // PACKET_NS
            return chosen(scan, random.random(int(packet.max(initial=0)) + 1)[packet] >= share)

        return each_scan(streams, span, lose)

    return apply


def thinned(share: float) -> Fault:
    """A share of the points, at random."""

    def apply(streams: Streams, span: Span) -> Streams:
        random = np.random.default_rng(13)
        return each_scan(streams, span, lambda scan: chosen(scan, random.random(len(scan.xyz_m)) < share))

    return apply


def handful(points: int) -> Fault:
    """That many points a scan, evenly; none for 0."""

    def keep(scan: LidarScan) -> LidarScan:
        return chosen(scan, np.linspace(0, len(scan.xyz_m) - 1, points).astype(np.int64))

    return lambda streams, span: each_scan(streams, span, keep)


def not_finite(share: float) -> Fault:
    """NaN, infinite and absurdly far coordinates among the others."""

    def apply(streams: Streams, span: Span) -> Streams:
        random = np.random.default_rng(14)
        rubbish = np.array([np.nan, np.inf, -np.inf, 1e30], np.float32)

        def spoil(scan: LidarScan) -> LidarScan:
            hit = random.random(scan.xyz_m.shape) < share
            return replace(scan, xyz_m=np.where(hit, random.choice(rubbish, scan.xyz_m.shape), scan.xyz_m))

        return each_scan(streams, span, spoil)

    return apply


def ground(above_m: float) -> Fault:
    """Nothing but the ground: what is higher than that above it is taken away."""

    def apply(streams: Streams, span: Span) -> Streams:
        def low(scan: LidarScan) -> LidarScan:
            motion = streams.truth.at(scan.stamp_ns + scan.offset_ns.astype(np.int64))
            height = np.einsum("nj,nj->n", motion.rotations[:, 2], scan.xyz_m)
            return chosen(scan, height < WALKER_FOOT_M + above_m)

        return each_scan(streams, span, low)

    return apply


def field(rough_m: float) -> Fault:
    """A level field to the horizon: every beam ends on it, or nowhere. rough_m: sigma of its height."""

    def apply(streams: Streams, span: Span) -> Streams:
        random = np.random.default_rng(16)
        ground_m: float | None = None

        def flat(scan: LidarScan) -> LidarScan:
            nonlocal ground_m
            motion = streams.truth.at(scan.stamp_ns + scan.offset_ns.astype(np.int64))
            turn = motion.rotations
            eye = motion.positions_m[:, 2] + (turn @ np.array(LIDAR_IN_BASE_M))[:, 2]
            ground_m = eye[0] + WALKER_FOOT_M if ground_m is None else ground_m
            ray = scan.xyz_m / np.maximum(np.linalg.norm(scan.xyz_m, axis=1), 1e-6)[:, None]
            down = np.einsum("nj,nj->n", turn[:, 2], ray)
            height = ground_m + rough_m * random.standard_normal(len(eye)) - eye
            reach = height / np.minimum(down, -1e-3)
            met = (down < -0.01) & (reach < FARTHEST_GROUND_M)
            return chosen(replace(scan, xyz_m=(ray * reach[:, None]).astype(np.float32)), met)

        return each_scan(streams, span, flat)

    return apply


def crown(farthest_m: float) -> Fault:
    """Leaves all around that move with the carrier's every step: no beam gets farther."""

    def apply(streams: Streams, span: Span) -> Streams:
        random = np.random.default_rng(15)

        def close(scan: LidarScan) -> LidarScan:
            distance = np.maximum(np.linalg.norm(scan.xyz_m, axis=1), 1e-6)
            leaf = random.uniform(0.2, farthest_m, len(distance)) / distance
            return replace(scan, xyz_m=(scan.xyz_m * leaf[:, None]).astype(np.float32))

        return each_scan(streams, span, close)

    return apply


def covered(streams: Streams, span: Span) -> Streams:
    """A sleeve over the left half of the lens: its points are gone, but a fifth returns from the cloth."""

    def cover(scan: LidarScan) -> LidarScan:
        left = scan.xyz_m[:, 1] > 0.0
        cloth = left & (np.arange(len(left)) % 5 == 0)
        distance = np.maximum(np.linalg.norm(scan.xyz_m, axis=1), 1e-6)
        xyz = np.where(cloth[:, None], 0.12 * scan.xyz_m / distance[:, None], scan.xyz_m).astype(np.float32)
        return chosen(replace(scan, xyz_m=xyz), ~left | cloth)

    return each_scan(streams, span, cover)


def mounted(axis: tuple[float, float, float], degrees: float) -> Fault:
    """The LiDAR sits turned in its mount, and the calibration does not know."""
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array(axis) / np.linalg.norm(axis)).as_matrix()

    def tilt(scan: LidarScan) -> LidarScan:
        return replace(scan, xyz_m=(scan.xyz_m @ turn.T).astype(np.float32))

    return lambda streams, span: each_scan(streams, span, tilt)
