"""A recorder that records nothing: speaks the control protocol, obeys start, stop and mark, and acts out faults.

To try the screen by hand: `python -m tests.ui.fake_recorder fake.sock`, then `mapforest tui --socket fake.sock`.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
import sys
import time
from pathlib import Path

import msgspec

from edge.control.codec import decode, encode
from edge.control.messages import Reply, Request, Status, Verdict
from ui import samples


class FakeRecorder:
    """One state, any number of clients. `heard` holds every request."""

    def __init__(self, period_s: float = 0.25, wobble: float = 0.0) -> None:
        self.status = samples.READY
        self.heard: list[Request] = []
        self._period_s = period_s
        self._wobble = wobble
        self._started_s = 0.0
        self._writers: list[asyncio.StreamWriter] = []

    @contextlib.asynccontextmanager
    async def serving(self, path: Path):
        """Serve on `path` until the block ends; then every client is cut off."""
        server = await asyncio.start_unix_server(self._serve, path)
        speaker = asyncio.create_task(self._speak())
        try:
            yield self
        finally:
            speaker.cancel()
            server.close()
            for writer in self._writers:
                writer.close()
            self._writers.clear()
            path.unlink(missing_ok=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while line := await reader.readline():
                request = decode(line)
                self.heard.append(request)
                writer.write(encode(self._obey(request)))
                if request.command == "subscribe":
                    self._writers.append(writer)
                self._tell()
        writer.close()

    def _obey(self, request: Request) -> Reply:
        session = samples.SESSION
        match request.command:
            case "start":
                self._started_s = time.monotonic()
                self.status = samples.recording(recording=msgspec.structs.replace(samples.RECORDING, marks=0))
            case "stop":
                verdict = Verdict(session, "WARN", samples.REASONS)
                self.status = samples.idle(verdict=verdict)
            case "mark":
                recording = self.status.recording
                if recording is None:
                    return Reply(request.id, False, "nothing is being recorded")
                recording = msgspec.structs.replace(recording, marks=recording.marks + 1)
                self.status = msgspec.structs.replace(self.status, recording=recording)
        return Reply(request.id, True, session=session)

    async def _speak(self) -> None:
        while True:
            await asyncio.sleep(self._period_s)
            self._tell()

    def _tell(self) -> None:
        for writer in self._writers:
            if not writer.is_closing():
                writer.write(encode(self._now()))

    def _now(self) -> Status:
        recording = self.status.recording
        if recording is None or not self._wobble:
            return self.status
        elapsed_s = time.monotonic() - self._started_s
        written = msgspec.structs.replace(recording, elapsed_s=elapsed_s, bytes_written=int(3.8e6 * elapsed_s))
        sensors = tuple(self._wobbling(sensor) for sensor in self.status.sensors)
        return msgspec.structs.replace(self.status, recording=written, sensors=sensors)

    def _wobbling(self, sensor):
        rates = (
            msgspec.structs.replace(stream, rate_hz=stream.rate_hz * random.gauss(1.0, self._wobble))
            for stream in sensor.streams
        )
        return msgspec.structs.replace(sensor, streams=tuple(rates))


async def main(path: Path) -> None:
    """Serve until interrupted; every 20 s the camera fails for 10 s."""
    recorder = FakeRecorder(wobble=0.01)
    async with recorder.serving(path):
        while True:
            await asyncio.sleep(20)
            good, bad = recorder.status.sensors, (samples.livox(), samples.reach_degraded(), samples.gopro_failed())
            recorder.status = msgspec.structs.replace(recorder.status, sensors=bad)
            await asyncio.sleep(10)
            recorder.status = msgspec.structs.replace(recorder.status, sensors=good)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(main(Path(sys.argv[1])))
