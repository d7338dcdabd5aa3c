"""The driver against the emulated LiDAR, end to end over UDP on loopback."""

import random
import time

import numpy as np
import pytest

from drivers.driver import SensorState
from drivers.livox.keys import Key
from drivers.livox.status import WorkState
from drivers.sim.livox_emulator import BROADCAST
from tests.drivers.livox.rig import driving, emulated, quick, running, streaming
from tests.waiting import wait_for


def test_streams_scans_and_inertial_samples():
    with running() as rig:
        streaming(rig, 6)
        health = rig.health()
        device = rig.emulator.device
    assert health.state is SensorState.OK, health
    assert health.temperature_c == pytest.approx(59.8)
    assert health.details["serial number"] == device.options.serial
    assert [stream.lost for stream in health.streams] == [0, 0]
    stamps = np.array([scan.stamp_ns for scan in rig.scans[:-1]])
    assert np.abs(np.diff(stamps) - 100_000_000).max() < 2_000_000
    for scan in rig.scans[1:-1]:
        assert len(scan.xyz_m) in (13_333, 13_334)  # 20,000 slots, a third without return
        assert (np.diff(scan.offset_ns.astype(np.int64)) > 0).all()
        assert scan.offset_ns.max() < 100_000_000
        assert (scan.offset_ns % 5000 == scan.offset_ns[0] % 5000).all()
        assert set(scan.line.tolist()) == {0, 1, 2, 3}
        assert set(scan.tag.tolist()) == {16}
    assert rig.samples[0].linear_acceleration == (0.0, 0.0, pytest.approx(9.80665))
    assert rig.samples[0].angular_velocity[:2] == (0.25, 0.5)


def test_points_and_inertial_samples_keep_their_relative_time():
    """Both tell their walk time: the points by their x (slots of 5 us), the samples by their yaw rate (s)."""
    with running() as rig:
        streaming(rig, 5)
    scan = rig.scans[2]
    sample = min(rig.samples, key=lambda sample: abs(sample.stamp_ns - scan.stamp_ns - 50_000_000))
    nearest = np.abs(scan.stamp_ns + scan.offset_ns.astype(np.int64) - sample.stamp_ns).argmin()
    by_stamps = scan.stamp_ns + int(scan.offset_ns[nearest]) - sample.stamp_ns
    point_s = (round(float(scan.xyz_m[nearest, 0]) * 1000) - 1) * 5e-6
    by_walk = point_s - sample.angular_velocity[2]
    # The slots tell the time within a tenth of a second only; on a busy machine the nearest sample is farther off.
    apart_s = (by_stamps / 1e9 - by_walk + 0.05) % 0.1 - 0.05
    assert apart_s == pytest.approx(0.0, abs=20e-6)


def test_finds_the_lidar_by_discovery_and_by_its_push():
    for uptime_s in (4100.0, 0.0):
        with emulated(uptime_s=uptime_s) as (emulator, _, host):
            settings = {"address": "", "serial_number": emulator.device.options.serial}
            with driving(emulator, quick("", host, settings)) as rig:
                streaming(rig, 2)


def test_polite_stop_leaves_the_lidar_idle():
    with emulated() as (emulator, lidar, host):
        with driving(emulator, quick(lidar, host)) as rig:
            streaming(rig, 2)
        wait_for(lambda: emulator.device.machine.state is WorkState.IDLE)


def test_losses_are_exactly_those_injected():
    with running() as rig:
        streaming(rig)
        for fault in ("livox:loss=0.05", "livox:duplicate=0.05", "livox:reorder=0.05"):
            rig.plan.begin(fault)
        wait_for(lambda: rig.emulator.points.tally.lost > 50 and rig.emulator.imu.tally.lost > 5)
        rig.plan.end()
        streaming(rig)
        streams = rig.health().streams
        details = rig.health().details
        points, imu = rig.emulator.points.tally, rig.emulator.imu.tally
    assert (streams[0].lost, streams[1].lost) == (points.lost, imu.lost)
    assert int(details["duplicate packets"]) == points.duplicated + imu.duplicated
    assert int(details["late packets"]) > 0


@pytest.mark.parametrize(
    ("device", "said"), [({"firmware_type": 0}, "loader"), ({"device_type": 35, "firmware_type": 1}, "Mid-360S")]
)
def test_refuses_what_it_does_not_speak_to(device, said):
    with running(**device) as rig:
        wait_for(lambda: rig.health().state is SensorState.FAILED)
        assert said in rig.health().problem


def test_nobody_there():
    with emulated() as (emulator, _, host):
        settings = {"address": "127.66.66.66", "discovery_address": BROADCAST}
        with driving(emulator, quick("", host, settings)) as rig:
            wait_for(lambda: "does not answer" in rig.health().problem)
            assert rig.health().state is SensorState.SEARCHING
            assert "check its power" in rig.health().advice


def test_reboot_is_noticed_and_survived():
    with running() as rig:
        streaming(rig, 2)
        rig.plan.begin("livox:reboot")
        wait_for(lambda: "the LiDAR started anew" in rig.events)
        streaming(rig, 4)
        health = rig.health()
        points = rig.emulator.points.tally
    assert health.clock is not None
    assert health.clock.steps == 1
    assert points.lost == 0
    assert health.streams[0].lost == 0
    stamps = [scan.stamp_ns for scan in rig.scans]
    assert stamps == sorted(stamps)


@pytest.mark.parametrize("step_s", [2.5, -3.0])
def test_clock_step_is_an_event_and_no_loss(step_s):
    with running() as rig:
        streaming(rig, 2)
        rig.plan.begin(f"livox:clock_step={step_s}")
        wait_for(lambda: any("jumped" in text for text in rig.events))
        streaming(rig, 5)
        health = rig.health()
    (event,) = [text for text in rig.events if "jumped" in text]
    late_ns = rig.lateness_ns() + 5_000_000
    assert float(event.split()[-2]) == pytest.approx(step_s, abs=late_ns / 1e9)
    assert [stream.lost for stream in health.streams] == [0, 0]
    for sample in rig.samples:  # stamps stay those of the host
        assert abs(sample.stamp_ns - rig.truth_ns(sample)) < late_ns
    for scan in rig.scans:
        assert abs(scan.receive_ns - scan.stamp_ns) < 0.1e9 + late_ns


def test_stall_is_seen_and_the_stream_picked_up_again():
    with running() as rig:
        streaming(rig, 2)
        rig.plan.begin("livox:stall")
        wait_for(lambda: rig.health().state is SensorState.SEARCHING)
        rig.plan.end()
        streaming(rig, 5)
        wait_for(lambda: rig.health().state is SensorState.OK)
        streams = rig.health().streams
    assert [stream.lost for stream in streams] == [0, 0]


def test_pulled_cable_loses_what_was_sent_meanwhile_and_no_more():
    with running() as rig:
        streaming(rig, 2)
        rig.plan.begin("livox:disconnect")
        wait_for(lambda: rig.health().state is SensorState.SEARCHING)
        wait_for(lambda: any("lost the LiDAR" in text for text in rig.events))
        wait_for(lambda: rig.emulator.points.tally.lost > 3000)
        rig.plan.end()
        streaming(rig, 5)
        streams = rig.health().streams
        points, imu = rig.emulator.points.tally, rig.emulator.imu.tally
    assert (streams[0].lost, streams[1].lost) == (points.lost, imu.lost)


def test_garbage_on_every_port_does_no_harm():
    with running("livox:garbage=400") as rig:
        streaming(rig, 8)
        health = rig.health()
    assert int(health.details["malformed packets"]) > 50
    assert [stream.lost for stream in health.streams] == [0, 0]
    assert health.state is SensorState.OK, health


def test_damaged_packets_are_dropped_or_counted_and_time_stays_sane():
    with running("livox:corrupt=0.05") as rig:
        streaming(rig, 10)
    stamps = np.diff([scan.stamp_ns for scan in rig.scans[1:-1]])
    assert np.abs(stamps - 100_000_000).max() < 5_000_000


def test_point_types_agree():
    for name, exact in (("cartesian_16", 0.0051), ("spherical", 0.003)):
        with running(settings={"point_type": name}) as rig:
            streaming(rig, 4)
        points = rig.scans[2].xyz_m
        np.testing.assert_allclose(points[:, 1:], np.broadcast_to((2.0, -0.3), (len(points), 2)), atol=exact * 3)


def test_lidar_sent_to_sleep_by_somebody_is_woken():
    with emulated() as (emulator, lidar, host), driving(emulator, quick(lidar, host)) as rig:
        streaming(rig, 2)
        emulator.device.machine.aim(WorkState.IDLE, time.monotonic_ns())
        wait_for(lambda: any("configuring it again" in text for text in rig.events))
        streaming(rig, 2)


def test_finds_its_own_address_by_the_route():
    """The route to loopback is from 127.0.0.1; unusual ports keep out of the way of other programs there."""
    first = random.SystemRandom().randrange(20_000, 30_000)
    names = ("host_command_port", "host_status_port", "host_point_port", "host_imu_port")
    ports = {name: first + 10 * at for at, name in enumerate(names)}
    with emulated() as (emulator, lidar, _), driving(emulator, quick(lidar, "", ports)) as rig:
        streaming(rig, 2)
        host = emulator.device.setting(Key.POINT_HOST)
    assert (host.address, host.port) == ("127.0.0.1", ports["host_point_port"])
