"""A walk without a forest: true antenna, odometry in a turned frame, and fixes with errors of one's choice."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from drivers.messages import FixQuality, GnssFix
from pipeline.estimates import OdometryEstimate
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.fusion import GnssFusion
from pipeline.gnss.geodesy import Datum

SECOND = 10**9
HOME = Datum(40.0573, -75.2183, 58.0)


@dataclass
class Walk:
    """A figure of eight about `size_m` wide at 1.2 m/s. `odom` is turned by -yaw and has its origin at the start."""

    seconds: float = 400.0
    yaw: float = 2.0
    size_m: float = 60.0
    seed: int = 1
    drift_m: float = 0.03
    drift_yaw_deg: float = 0.01
    config: FusionConfig = field(default_factory=FusionConfig)

    def __post_init__(self):
        random = np.random.default_rng(self.seed)
        self.stamps = np.arange(0, int(self.seconds * 10)) * (SECOND // 10)
        self.truth = self.place(self.stamps / 1e9)
        ahead = self.place(self.stamps / 1e9 + 0.01) - self.truth
        heading = np.arctan2(ahead[:, 1], ahead[:, 0])
        steps = np.diff(self.truth, axis=0)
        length = np.linalg.norm(steps, axis=1)
        self.way = np.concatenate([[0.0], np.cumsum(length)])
        kicks = random.standard_normal((len(length), 4)) * np.sqrt(length)[:, None]
        turn = np.concatenate([[0.0], np.cumsum(math.radians(self.drift_yaw_deg) * kicks[:, 3])]) - self.yaw
        moved = np.array([rz(a) @ (s + self.drift_m * k) for a, s, k in zip(turn, steps, kicks[:, :3], strict=False)])
        self.odom = np.concatenate([np.zeros((1, 3)), np.cumsum(moved, axis=0)])
        self.rotations = np.array([rz(a + h) for a, h in zip(turn, heading, strict=True)])
        self.true_rotations = np.array([rz(h) for h in heading])

    def place(self, t_s):
        """(n, 3) of base_link."""
        along = 1.2 * np.asarray(t_s) / self.size_m
        return self.size_m * np.stack([np.sin(along), 0.5 * np.sin(2.0 * along), 0.02 * np.sin(along)], axis=-1)

    def estimate(self, k, **changes):
        values = {
            "stamp_ns": int(self.stamps[k]),
            "position_m": self.odom[k],
            "rotation": self.rotations[k],
            "velocity_m_s": np.zeros(3),
            "covariance": np.eye(6) * 1e-4,
            "gyro_bias": np.zeros(3),
            "accel_bias": np.zeros(3),
            "travelled_m": float(self.way[k]),
            "degenerate": False,
            "weak_directions": np.zeros((0, 3)),
            "points": 1000,
            "matches": 900,
        }
        return OdometryEstimate(**(values | changes))

    def estimates(self):
        return [self.estimate(k) for k in range(len(self.stamps))]

    def antenna(self, stamp_ns):
        """(3,) true."""
        here, soon = self.place(stamp_ns / 1e9), self.place(stamp_ns / 1e9 + 0.01)
        heading = math.atan2(soon[1] - here[1], soon[0] - here[0])
        return here + rz(heading) @ np.array(self.config.antenna_m)

    def fixes(
        self, *, start_s=0.0, end_s=math.inf, sigma_m=0.3, said=1.0, quality=FixQuality.RTK_FLOAT, lasting_s=20.0
    ):
        """At 5 Hz. The error is Gauss-Markov over `lasting_s` and a tenth white; said: sigma claimed."""
        random = np.random.default_rng((self.seed, 5))
        keep = math.exp(-0.2 / lasting_s) if lasting_s else 0.0
        lasting, found = random.standard_normal(3), []
        for stamp in range(0, int(min(end_s, self.seconds - 0.2) * SECOND), SECOND // 5):
            lasting = keep * lasting + math.sqrt(1 - keep**2) * random.standard_normal(3)
            error = sigma_m * (math.sqrt(0.91) * lasting + 0.3 * random.standard_normal(3)) * [1.0, 1.0, 1.6]
            if stamp >= start_s * SECOND:
                found.append(fix_at(stamp, self.antenna(stamp) + error, said * sigma_m, quality))
        return found


def rz(yaw):
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def fix_at(stamp_ns, enu_m, sigma_m, quality=FixQuality.RTK_FLOAT, delay_ns=0):
    latitude, longitude, height = HOME.geodetic(np.asarray(enu_m, dtype=np.float64))
    return GnssFix(
        stamp_ns=stamp_ns,
        receive_ns=stamp_ns + delay_ns,
        utc_ns=0,
        date_assumed=False,
        quality=quality,
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        geoid_separation_m=-33.6,
        satellites=14,
        hdop=0.8,
        age_s=1.0,
        sigma_enu_m=(sigma_m, sigma_m, 1.6 * sigma_m),
        sigma_source="gst",
    )


def moved_by(fix, enu_m):
    """The same fix elsewhere."""
    place = HOME.enu(fix.latitude_deg, fix.longitude_deg, fix.height_m) + np.asarray(enu_m)
    return fix_at(fix.stamp_ns, place, fix.sigma_enu_m[0], fix.quality)


def fused(walk, fixes, delay_ns=0, every=5):
    """The fusion after the whole walk, and of each global pose: stamp (s), error (3,), covariance (6, 6)."""
    fusion = GnssFusion(walk.config)
    waiting = list(fixes)
    rows = []
    for k, estimate in enumerate(walk.estimates()):
        fusion.add_odometry(estimate)
        while waiting and waiting[0].stamp_ns + delay_ns <= estimate.stamp_ns:
            fusion.add_fix(waiting.pop(0))
        pose = fusion.global_pose(estimate) if k % every == 0 else None
        if pose is not None:
            place = HOME.enu(*Datum(*fusion.state().datum).geodetic(pose.position_enu_m))
            rows.append((estimate.stamp_ns / 1e9, place - walk.truth[k], pose.covariance))
    return fusion, rows


def sizes(rows, since_s=0.0):
    """Error (m) of each pose after a time."""
    return np.array([np.linalg.norm(error) for t, error, _ in rows if t >= since_s])
