"""The faults, each with when it begins and how long it lasts, and the walks that they befall."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec
from scipy.spatial.transform import Rotation

from benchmarks.odometry.faults import delivery, inertial, laser
from benchmarks.odometry.faults.streams import Fault, Streams, both
from benchmarks.odometry.simulated import Turn, walk
from drivers.sim.motion import Schedule
from drivers.sim.scenarios import WorldConfig, scenario
from pipeline.evaluation.trajectory import Trajectory
from pipeline.odometry.config import ImuConfig, OdometryConfig

BEGIN_S, LASTS_S, LONGEST_S = 9.0, 5.0, 25.0
ALL_S = 1e6
"""From there to the end."""
PLAIN = replace(scenario("demo"), name="faults", schedule=Schedule(rest_s=2.0))
TURNS = (Turn(BEGIN_S, 2.4, 360.0), Turn(15.0, 0.4, 180.0))
"""At 300 and at 900 degrees a second where they are fastest."""
RANGE_RAD_S, RANGE_M_S2 = math.radians(20.0), 10.5
NARROW = msgspec.structs.replace(
    OdometryConfig(), imu=ImuConfig(gyro_range_rad_s=RANGE_RAD_S, accel_range_m_s2=RANGE_M_S2)
)
CROSSING = (
    ((2.0, -3.0), (0.0, 1.2)),
    ((1.2, 4.0), (0.1, -1.3)),
    ((-1.0, -4.0), (0.2, 1.5)),
    ((5.0, 0.5), (-1.2, 0.0)),
)
BESIDE = (((-1.2, 0.3), (0.0, 0.0)), ((0.4, -1.0), (0.0, 0.0)))


@dataclass(frozen=True, slots=True)
class Case:
    """name: for people. begin_s: after the start of the walk, which rests for two seconds and walks from the fifth on.

    leaps_s: by how much stamps of the fault are wrong for good, so that estimates are judged at their true time.
    """

    name: str
    fault: Fault
    begin_s: float = BEGIN_S
    lasts_s: float = LASTS_S
    config: OdometryConfig = field(default_factory=OdometryConfig)
    leaps_s: float = 0.0
    turning: bool = False


def nothing(streams: Streams, _: object) -> Streams:
    """No fault."""
    return streams


def leaping(by_s: float) -> Fault:
    """All stamps leap."""
    return both(delivery.leaping_scans(by_s), delivery.leaping_samples(by_s))


CASES: dict[str, Case] = {
    "none": Case("none", nothing),
    "turn": Case("a full turn at up to 300 deg/s, half a turn at up to 900", nothing, lasts_s=7.0, turning=True),
    "walkers": Case("four walkers cross within 1 to 5 m", laser.walkers(CROSSING)),
    "companions": Case("two people walk along at 1 m, all the way", laser.walkers(BESIDE), 0.0, ALL_S),
    "wind": Case("wind: what is above sways by up to 0.2 m", laser.waving(0.2, 0.4)),
    "dust_tagged": Case("dust in a third of the beams, tagged as such", laser.particles(0.35, 4.0, 1.0)),
    "dust": Case("dust in a third of the beams, untagged", laser.particles(0.35, 4.0, 0.0)),
    "rain": Case("rain in a tenth of the beams, half of it tagged", laser.particles(0.1, 15.0, 0.5)),
    "covered": Case("half of the lens covered", laser.covered),
    "crown": Case("leaves within 1 m on all sides, others each scan", laser.crown(1.0)),
    "field": Case("a level field and nothing else, all the way", laser.field(0.02), 0.0, ALL_S),
    "ground": Case("nothing but the ground in view", laser.ground(0.15)),
    "elsewhere": Case("points of another place altogether", laser.field(0.02)),
    "thin": Case("a tenth of the points", laser.thinned(0.1)),
    "handful": Case("12 points a scan", laser.handful(12)),
    "empty": Case("scans without points for 2 s", laser.handful(0), lasts_s=2.0),
    "not_finite": Case("a tenth of the coordinates NaN, infinite or 1e30", laser.not_finite(0.1)),
    "packets_5": Case("5 % of the LiDAR's packets lost", laser.lost_packets(0.05)),
    "packets_30": Case("30 % of the LiDAR's packets lost", laser.lost_packets(0.30)),
    "laser_2": Case("no scans for 2 s", delivery.no_scans, lasts_s=2.0),
    "laser_6": Case("no scans for 6 s", delivery.no_scans, lasts_s=6.0),
    "samples_10": Case("10 % of the inertial samples lost, singly", inertial.lost_samples(0.1)),
    "samples_02": Case("no inertial samples for 0.2 s", delivery.no_samples, lasts_s=0.2),
    "samples_07": Case("no inertial samples for 0.7 s", delivery.no_samples, lasts_s=0.7),
    "samples_3": Case("no inertial samples for 3 s", delivery.no_samples, lasts_s=3.0),
    "silence_3": Case("neither for 3 s", both(delivery.no_scans, delivery.no_samples), lasts_s=3.0),
    "silence_8": Case("neither for 8 s", both(delivery.no_scans, delivery.no_samples), lasts_s=8.0),
    "saturated": Case(
        "gyro ends at 20 deg/s, accelerometer at 1.07 g, as configured",
        inertial.saturated(RANGE_RAD_S, RANGE_M_S2),
        begin_s=0.0,
        lasts_s=ALL_S,
        config=NARROW,
    ),
    "saturated_unknown": Case("the same, and nobody knows", inertial.saturated(RANGE_RAD_S, RANGE_M_S2)),
    "gyro_bias": Case("gyro bias jumps by 1 deg/s, all axes", inertial.biased(gyro_rad_s=(0.017, -0.017, 0.017))),
    "gyro_bias_large": Case("gyro bias jumps by 10 deg/s, heading", inertial.biased(gyro_rad_s=(0.0, 0.0, 0.17))),
    "accel_bias": Case("accelerometer bias jumps by 0.3 m/s², all axes", inertial.biased(accel_m_s2=(0.3, -0.3, 0.3))),
    "accel_bias_large": Case("accelerometer bias jumps by 2 m/s²", inertial.biased(accel_m_s2=(2.0, 0.0, 0.0))),
    "in_g": Case("accelerometer in g", inertial.in_g, 0.0, ALL_S),
    "in_g_midway": Case("accelerometer in g, from the middle on", inertial.in_g, BEGIN_S, ALL_S),
    "mounted_pitch": Case("LiDAR pitched by 3° in its mount", laser.mounted((0.0, 1.0, 0.0), 3.0), 0.0, ALL_S),
    "mounted_yaw": Case("LiDAR yawed by 3° in its mount", laser.mounted((0.0, 0.0, 1.0), 3.0), 0.0, ALL_S),
    "offset_20": Case("points stamped 20 ms late", delivery.leaping_scans(0.02), 0.0, ALL_S),
    "late": Case("scans delivered 1 s late", delivery.late_scans(1.0)),
    "late_fifth": Case("every fifth scan delivered 1 s late", delivery.late_scans(1.0, 5)),
    "scans_disordered": Case("scans out of order and doubled", delivery.disordered_scans),
    "samples_disordered": Case("inertial samples out of order and doubled", delivery.disordered_samples),
    "leap_scan": Case("one scan stamped 100 s ahead", delivery.leaping_scans(100.0), lasts_s=0.1),
    "leap_sample": Case("one inertial sample stamped 100 s ahead", delivery.leaping_samples(100.0), lasts_s=0.005),
    "leap_second": Case("all stamps 100 s ahead for 1 s, and back", leaping(100.0), lasts_s=1.0),
    "leap_on": Case("all stamps leap 100 s ahead for good", leaping(100.0), lasts_s=ALL_S, leaps_s=100.0),
    "leap_back": Case("all stamps leap 4 s back for good", leaping(-4.0), lasts_s=ALL_S, leaps_s=-4.0),
}


def cast(cache: Path, *, turning: bool) -> Streams:
    """A walk without faults, in memory; cast now or taken from `cache`."""
    config = replace(PLAIN, name="faults_turning") if turning else PLAIN
    return cast_walk(config, cache, LONGEST_S, TURNS if turning else ())


def cast_walk(config: WorldConfig, cache: Path, longest_s: float, turns: tuple[Turn, ...] = ()) -> Streams:
    """Any walk of the simulator's."""
    one = walk(config, cache, longest_s, turns)
    stamps, position, quaternion, _ = one.truth()
    truth = Trajectory(stamps, position, Rotation.from_quat(quaternion).as_matrix())
    return Streams(tuple(one.scans()), tuple(one.imu()), truth)
