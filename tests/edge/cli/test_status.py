"""The compact view of `mapforest status`."""

from edge.cli.status import lines
from edge.control.messages import Clock, Detecting, Gnss, Host, Recording, Sensor, Status, Stream, Verdict

HOST = Host(
    cpu_percent=31.4,
    memory_percent=40.0,
    temperature_c=66.0,
    throttled=True,
    disk_free_bytes=50 << 30,
    disk_remaining_s=7265.0,
    battery_remaining_s=None,
    queue_fill=0.02,
    clock_synchronised=False,
    clock_source="none",
)


def test_everything_an_operator_needs_is_there() -> None:
    status = Status(
        stamp_ns=0,
        state="recording",
        sensors=(
            Sensor(
                "livox",
                "degraded",
                (Stream("points", 9.9, 10.0, 99, 2, 0.1), Stream("imu", 200.0, 200.0, 2000, 0, 0.01)),
                Clock(0.05, 1.0, 0.2, 0),
                "2 packets lost",
                "check the cable",
                61.0,
            ),
            Sensor("gopro", "searching", problem="nobody answers", advice="switch it on", battery_percent=80.0),
        ),
        host=HOST,
        gnss=Gnss(5, "RTK float", 14, 0.5, 0.9, 0.2),
        recording=Recording("s1", "/rec/s1", "walk", 61.0, 3 << 20, 1234, 1, 2, 12.0, 0),
        verdict=Verdict("s0", "WARN", ("gap of 2 s on /gnss/fix",)),
        problems=("the card is slow",),
        detecting=Detecting("slowed", "ailanthus", "ab12", "cpu", 1.0, 412.3, 2, note="80 °C: 1.0 images/s"),
    )
    assert list(lines(status)) == [
        "RECORDING s1  0:01:01",
        "  3.0 MiB, 1234 messages, split 0, 2 marks, 1 dropped, last flush 12 ms",
        "  /rec/s1",
        "livox    degraded   points 9.9/10 Hz lost 2  imu 200.0/200 Hz  61 C  clock +-0.05 ms",
        "  ! 2 packets lost: check the cable",
        "gopro    searching  battery 80 %",
        "  ! nobody answers: switch it on",
        "gnss     RTK float, 14 satellites, sigma 0.50 m horizontal 0.90 m vertical, 0.2 s ago",
        "detect   slowed, ailanthus on cpu, 1.0 images/s, 412 ms behind, 2 boxes in the last second  "
        "80 °C: 1.0 images/s",
        "host     cpu 31 %, memory 40 %, 66 C, THROTTLED",
        "card     50.0 GiB free, 2:01:05 left, queue 2%",
        "clock    not synchronised",
        "verdict  WARN s0",
        "  - gap of 2 s on /gnss/fix",
        "! the card is slow",
    ]
