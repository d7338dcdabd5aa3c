"""The other programs: how each is asked what is in a session, each in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

PROBES = Path(__file__).with_name("probes")


class PeerFailed(Exception):
    """A program could not open the session. The text is its own last words."""


@dataclass(frozen=True, slots=True)
class Asked:
    """A session and the peers. python: of the environment they are in; node_modules: where `@mcap/core` is."""

    session: Path
    python: Path
    node_modules: Path
    lidar: str
    imu: str
    scans: int
    timeout_s: float

    @property
    def files(self) -> list[str]:
        """The splits in order."""
        return [str(path) for path in sorted(self.session.glob("*.mcap"), key=_number)]


def rosbags_folder(asked: Asked) -> dict[str, int]:
    """The folder by its metadata.yaml, every message decoded by the definitions in the files."""
    return _counts(asked, [asked.python, PROBES / "rosbags_reader.py", asked.session])


def rosbags_files(asked: Asked) -> dict[str, int]:
    """The files one by one, by the rosbags of this environment: peers may pin 0.9, which reads folders only."""
    return _counts(asked, [sys.executable, PROBES / "rosbags_reader.py", *asked.files])


def node(asked: Asked) -> dict[str, int]:
    """`@mcap/core`: every message of every file by the index, checksums verified."""
    environment = {"NODE_PATH": str(asked.node_modules.resolve())}
    return _counts(asked, ["node", PROBES / "mcap_core.cjs", *asked.files], environment)


def kiss_icp_loader(asked: Asked) -> dict[str, int]:
    """Scans with points in them, as its ROS bag loader gives them."""
    return _counts(asked, [asked.python, PROBES / "kiss_icp_loader.py", asked.session, asked.lidar])


def kiss_icp(asked: Asked) -> dict[str, int]:
    """Its command line on the first scans: poses it wrote."""
    with tempfile.TemporaryDirectory() as folder:
        command = [_beside(asked.python, "kiss_icp_pipeline"), asked.session, "--topic", asked.lidar, "-n", asked.scans]
        _run(asked, command, {"kiss_icp_out_dir": folder})
        return {asked.lidar: _lines(next(Path(folder).glob("2*/*_poses_tum.txt")))}


def rko_lio(asked: Asked) -> dict[str, int]:
    """Its command line on everything: poses it wrote, one a scan."""
    with tempfile.TemporaryDirectory() as folder:
        topics = ["--lidar", asked.lidar, "--imu", asked.imu]
        _run(asked, [_beside(asked.python, "rko_lio"), asked.session, *topics, "--log_dir", folder], {})
        return {asked.lidar: _lines(next(Path(folder).glob("*/*_tum.txt")))}


def _counts(asked: Asked, command: Sequence[object], environment: Mapping[str, str] = {}) -> dict[str, int]:
    counts: dict[str, int] = json.loads(_run(asked, command, environment).splitlines()[-1])
    return counts


def _run(asked: Asked, command: Sequence[object], environment: Mapping[str, str]) -> str:
    words = [str(word) for word in command]
    try:
        done = subprocess.run(
            words,
            capture_output=True,
            text=True,
            timeout=asked.timeout_s,
            env={**os.environ, **environment},
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise PeerFailed(f"not ready after {asked.timeout_s:.0f} s") from error
    except OSError as error:
        raise PeerFailed(f"{words[0]}: {error.strerror}") from error
    if done.returncode != 0:
        raise PeerFailed((done.stderr.strip() or done.stdout.strip() or f"exit {done.returncode}").splitlines()[-1])
    return done.stdout


def _beside(python: Path, program: str) -> Path:
    """A command of the environment `python` is in; not resolved, since that would leave the environment."""
    return python.parent / program


def _lines(path: Path) -> int:
    return len(path.read_text().splitlines())


def _number(path: Path) -> tuple[int, str]:
    number = path.stem.rpartition("_")[2]
    return (int(number) if number.isdecimal() else 0), path.name
