"""A HERO8 that sends a canned second of video over and over; only times and continuity counters are written anew."""

from __future__ import annotations

import time
from random import Random

import numpy as np

from benchmarks.recording.load import FRAME_BYTES, HTTP_PORT, KEYFRAME_BYTES, KEYFRAME_EVERY, Load
from drivers.sim import gopro_emulator
from drivers.sim.faults import FaultPlan
from drivers.sim.transport_mux import PACKET, PCR_LEAD, VIDEO_PID, TransportMux

CANNED = 30
"""Frames made before."""
START = b"\x00\x00\x00\x01"
PARAMETERS = START + bytes.fromhex("6764001facd940d83de6f01100000300010000030032") + START + bytes.fromhex("68ebecb22c")
PES_STAMP = 9
"""Where the time stands in a PES packet."""


class CannedCamera(gopro_emulator.Emulator):
    """The emulated HERO8 with its HTTP side and keep-alive; its stream is sent as cheaply as can be."""

    def __init__(self, load: Load, epoch_ns: int) -> None:
        super().__init__(_Nothing(), FaultPlan("gopro", ()), epoch_ns, load.camera, HTTP_PORT)
        self._load = load
        self._canned = [_Frame(packets) for packets in _mux(load)]

    def _make(self) -> None:
        """Nothing is filmed."""

    def _send(self) -> None:
        """Frame k leaves when its time has come, in datagrams of seven packets."""
        index = 0
        began_ns = time.monotonic_ns()
        counters: dict[int, int] = {}
        while not self._stopping.is_set():
            pts = index * self._load.frame_90khz
            due_s = (began_ns + pts * 100_000 // 9 - time.monotonic_ns()) / 1e9
            if due_s > 0 and self._stopping.wait(due_s):
                return
            data = self._canned[index % CANNED].at(pts + 90_000, counters)
            with self.lock:
                target = self.device.stream_to
            if target is not None:
                for at in range(0, len(data), gopro_emulator.DATAGRAM):
                    self._put(data[at : at + gopro_emulator.DATAGRAM], target)
                self.sent += 1
            index += 1


class _Frame:
    """Transport packets of one frame, (n, 188)."""

    def __init__(self, data: bytes) -> None:
        self._packets = np.frombuffer(data, np.uint8).reshape(-1, PACKET).copy()
        pids = (self._packets[:, 1] & 0x1F).astype(int) << 8 | self._packets[:, 2]
        self._rows = {int(pid): np.flatnonzero(pids == pid) for pid in np.unique(pids)}
        first = self._packets[self._rows[VIDEO_PID][0]]
        self._pes = 4 + (1 + int(first[4]) if first[3] & 0x20 else 0)

    def at(self, pts: int, counters: dict[int, int]) -> bytes:
        """The packets with this time. `counters` goes from frame to frame."""
        packets = self._packets
        for pid, rows in self._rows.items():
            counter = counters.get(pid, 0)
            packets[rows, 3] = packets[rows, 3] & 0xF0 | (counter + np.arange(len(rows))) & 0x0F
            counters[pid] = counter + len(rows)
        row = packets[self._rows[VIDEO_PID][0]]
        fresh = np.frombuffer(TransportMux().video(b"", pts), np.uint8).reshape(-1, PACKET)[-1]
        at = 4 + 1 + int(fresh[4]) + PES_STAMP
        row[self._pes + PES_STAMP : self._pes + PES_STAMP + 5] = fresh[at : at + 5]
        row[6:12] = fresh[6:12]  # the reference clock, PCR_LEAD behind
        return packets.tobytes()


def _mux(load: Load) -> list[bytes]:
    random, mux = Random(3), TransportMux()
    frames = []
    for index in range(CANNED):
        key = index % KEYFRAME_EVERY == 0
        slice_bytes = random.randbytes(KEYFRAME_BYTES if key else FRAME_BYTES).replace(b"\x00", b"\x55")
        unit = (PARAMETERS if key else b"") + START + (b"\x65" if key else b"\x41") + slice_bytes
        frames.append(mux.video(unit, PCR_LEAD + index * load.frame_90khz))
    return frames


class _Nothing:
    """The source of a stream that is canned."""

    def access_unit(self, index: int) -> tuple[bytes, bool]:
        raise NotImplementedError
