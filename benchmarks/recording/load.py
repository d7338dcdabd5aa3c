"""The load: every stream of the payload at its full rate, or at a multiple of it with sensor time to match."""

from __future__ import annotations

from dataclasses import dataclass, field
from random import randint

from drivers.livox.packets import POINTS_PER_PACKET

RETURNS_PER_PACKET = 53
"""Of 96 slots: 45 % are no-returns, as in a forest with sky above."""
SENTENCES_PER_EPOCH = 8
KEYFRAME_EVERY = 15
KEYFRAME_BYTES = 30_000
FRAME_BYTES = 11_200
"""With the keyframes 12.5 kB a frame in the mean: 3 Mbit/s at 30 frames a second."""
GNSS_PORT, HTTP_PORT = 9001, 8080


@dataclass(frozen=True, slots=True)
class Load:
    """factor 1: 200,000 points/s, IMU 200 Hz, GNSS 10 Hz, video 30 frames/s. 5: five times as dense.

    network: first three numbers of the loopback addresses; any, so that nothing else on the machine is met.
    """

    factor: int = 1
    network: str = field(default_factory=lambda: f"127.{randint(30, 250)}.{randint(1, 250)}")

    @property
    def host(self) -> str:
        return f"{self.network}.1"

    @property
    def lidar(self) -> str:
        return f"{self.network}.10"

    @property
    def receiver(self) -> str:
        return f"{self.network}.20"

    @property
    def camera(self) -> str:
        return f"{self.network}.30"

    @property
    def packet_ns(self) -> int:
        """From one point packet to the next."""
        return 480_000 // self.factor

    @property
    def point_ns(self) -> int:
        return self.packet_ns // POINTS_PER_PACKET

    @property
    def imu_ns(self) -> int:
        return 5_000_000 // self.factor

    @property
    def epoch_ns(self) -> int:
        """From one GNSS epoch to the next."""
        return 100_000_000 // self.factor

    @property
    def frame_90khz(self) -> int:
        """From one video frame to the next, in ticks of the stream's clock."""
        return 3000 // self.factor

    def sensor_tables(self) -> dict[str, dict[str, object]]:
        """`sensors` of the recorder's configuration."""
        return {
            "livox": {"driver": "livox", "address": self.lidar, "host_address": self.host},
            "reach": {
                "driver": "reach",
                "endpoint": f"tcp:{self.receiver}:{GNSS_PORT}",
                "rate_hz": 1e9 / self.epoch_ns,
            },
            "gopro": {
                "driver": "gopro",
                "address": self.camera,
                "http_port": HTTP_PORT,
                "host": self.host,
                "expected_hz": 90_000.0 / self.frame_90khz,
            },
        }
