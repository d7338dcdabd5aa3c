"""Scans: exact times, exact windows, whatever the order of the packets."""

import numpy as np
import pytest

from drivers.livox.packets import PACKET_NS, POINT_INTERVAL, RECORDS, DataType
from drivers.livox.scan import PERIOD_NS, PointPackets, ScanAssembler
from drivers.messages import LidarScan

START = 7_000_000_123
HOST = 10**13


def packets(indices, data_type=DataType.CARTESIAN_32, first_x=1) -> PointPackets:
    """Packets of 96 points; x counts the slots of 5 us from `first_x`."""
    indices = np.asarray(indices, np.int64)
    records = np.zeros((len(indices), 96), RECORDS[data_type])
    slots = indices[:, None] * 96 + np.arange(96)
    if data_type == DataType.SPHERICAL:
        records["depth"] = slots + first_x
        records["theta"] = 9000
    else:
        records["xyz"][..., 0] = slots + first_x
    records["reflectivity"] = slots % 251
    records["tag"] = slots % 7
    sensor_ns = START + indices * PACKET_NS
    return PointPackets(
        data_type, sensor_ns, np.full(len(indices), POINT_INTERVAL), sensor_ns + HOST + 600_000, records
    )


def assembled(groups) -> tuple[list[LidarScan], ScanAssembler]:
    scans: list[LidarScan] = []
    assembler = ScanAssembler(lambda sensor_ns: sensor_ns + HOST, scans.append)
    for group in groups:
        assembler.add(group)
    assembler.flush()
    return scans, assembler


def slots_of(scan: LidarScan) -> np.ndarray:
    return np.rint(scan.xyz_m[:, 0].astype(np.float64) * 1000).astype(np.int64) - 1


def test_every_point_has_its_exact_time():
    (first, *_), _ = assembled([packets(range(at, at + 23)) for at in range(0, 230, 23)])
    slots = slots_of(first)
    assert first.stamp_ns == START + HOST
    np.testing.assert_array_equal(slots, np.arange(20_000))
    np.testing.assert_array_equal(first.offset_ns, slots * 5000)
    np.testing.assert_array_equal(first.line, slots % 96 % 4)
    np.testing.assert_array_equal(first.reflectivity, slots % 251)
    np.testing.assert_array_equal(first.tag, slots % 7)
    assert first.receive_ns == START + HOST + 600_000 + 208 * PACKET_NS


def test_windows_do_not_drift_over_a_thousand_scans():
    sent: list[tuple[int, int]] = []
    assembler = ScanAssembler(lambda ns: ns, lambda scan: sent.append((scan.stamp_ns, len(scan.xyz_m))))
    part = packets(range(625))  # three scans
    part.records["xyz"] = 1
    for turn in range(334):
        sensor_ns = part.sensor_ns + turn * 625 * PACKET_NS
        assembler.add(PointPackets(part.data_type, sensor_ns, part.interval, part.receive_ns, part.records))
    stamps, counts = zip(*sent, strict=True)
    assert set(counts) == {20_000}  # 208.33 packets of 96
    assert len(stamps) >= 1000
    np.testing.assert_array_equal(stamps, START + np.arange(len(stamps)) * PERIOD_NS)


def test_reordered_and_doubled_packets_are_put_in_place():
    order = np.arange(460)
    swapped = order.reshape(-1, 2)[:, ::-1].ravel()
    doubled = np.repeat(swapped, 2)
    expected, _ = assembled([packets(order)])
    got, assembler = assembled([packets(doubled[at : at + 10]) for at in range(0, len(doubled), 10)])
    assert assembler.too_late == 0
    for one, other in zip(expected, got, strict=True):
        np.testing.assert_array_equal(one.xyz_m, other.xyz_m)
        np.testing.assert_array_equal(one.offset_ns, other.offset_ns)


def test_lost_packets_leave_holes_and_move_nothing():
    kept = [index for index in range(460) if index == 0 or index % 10]
    scans, _ = assembled([packets(kept)])
    for number, scan in enumerate(scans[:2]):
        slots = slots_of(scan)
        np.testing.assert_array_equal(scan.offset_ns, slots * 5000 - number * PERIOD_NS)
        assert not ((slots // 96 > 0) & (slots // 96 % 10 == 0)).any()


def test_windows_keep_their_grid_over_a_silence():
    scans, _ = assembled([packets(range(300)), packets(range(10_000, 10_300))])
    assert all((scan.stamp_ns - START - HOST) % PERIOD_NS == 0 for scan in scans)
    stamps = [(scan.stamp_ns - START - HOST) // PERIOD_NS for scan in scans]
    assert stamps == [0, 1, 48, 49]


def test_packets_after_their_scan_went_out_are_counted():
    scans, assembler = assembled([packets(range(100)), packets(range(200, 300)), packets([150])])
    assert assembler.too_late == 1
    assert [len(scan.xyz_m) for scan in scans] == [9600 + 20_000 - 200 * 96, 300 * 96 - 20_000]


def test_no_returns_are_removed_after_timing():
    part = packets(range(230))
    part.records["xyz"][:, ::3] = 0
    (scan, *_), _ = assembled([part])
    slots = slots_of(scan)
    assert len(slots) == 20_000 - 6667
    np.testing.assert_array_equal(scan.offset_ns, slots * 5000)


def test_scan_without_any_return_still_goes_out():
    part = packets(range(230))
    part.records["xyz"] = 0
    (scan, *_), _ = assembled([part])
    assert scan.xyz_m.shape == (0, 3)


def test_change_of_point_type_within_a_scan():
    (scan, *_), _ = assembled([packets(range(100)), packets(range(100, 230), DataType.SPHERICAL)])
    np.testing.assert_array_equal(slots_of(scan), np.arange(20_000))
    np.testing.assert_array_equal(scan.offset_ns, np.arange(20_000) * 5000)


@pytest.mark.parametrize("flushes", [1, 2])
def test_flush_begins_anew(flushes):
    scans: list[LidarScan] = []
    assembler = ScanAssembler(lambda ns: ns, scans.append)
    assembler.add(packets(range(10)))
    for _ in range(flushes):
        assembler.flush()
    part = packets(range(230))
    assembler.add(PointPackets(part.data_type, part.sensor_ns - 10**9, part.interval, part.receive_ns, part.records))
    assert [scan.stamp_ns for scan in scans] == [START, START - 10**9]
