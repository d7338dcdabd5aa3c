"""A Reach M2 that says eight sentences an epoch over TCP."""

from __future__ import annotations

import time

from benchmarks.recording.load import GNSS_PORT, SENTENCES_PER_EPOCH, Load
from drivers.sim.reach_emulator_nmea import SentenceSet, sentences
from drivers.sim.reach_emulator_ports import TcpServer
from drivers.sim.sources import GnssEpoch, StopFlag

EPOCH = GnssEpoch(48.2, 16.3, 320.0, 44.0, 5, 14, 0.9, 1.0, (0.2, 0.2, 0.4), 1.2, 87.0)
LATENCY_NS = 30_000_000


def run(load: Load, stop: StopFlag) -> None:
    """Epochs on round instants of UTC, 30 ms after them, until `stop`."""
    server = TcpServer(load.receiver, GNSS_PORT)
    server.open()
    rest = _untimed()
    offset_ns = time.time_ns() - time.monotonic_ns()
    utc_ns = (time.time_ns() // 1_000_000_000 + 1) * 1_000_000_000
    try:
        while not stop.wait(max(0.0, (utc_ns + LATENCY_NS - offset_ns - time.monotonic_ns()) / 1e9)):
            timed = sentences(EPOCH, utc_ns, SentenceSet(satellites=False, velocity=False, date=False))[:3]
            burst = [*timed[:2], *rest, timed[2]]
            assert len(burst) == SENTENCES_PER_EPOCH
            server.send(b"".join(burst))
            utc_ns += load.epoch_ns
    finally:
        server.close()


def _untimed() -> list[bytes]:
    """GSA of four constellations and VTG."""
    return [one for one in sentences(EPOCH, 0, SentenceSet()) if one[3:6] in (b"GSA", b"VTG")]
