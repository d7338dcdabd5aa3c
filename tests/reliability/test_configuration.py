"""Configuration files that are wrong: the recorder says what and where, and ends with 1 before it touches anything."""

import subprocess
import sys

import pytest

from edge.cli import exit_codes
from edge.cli.main import main
from tests.reliability.chain import ROOT

BROKEN = {
    "grammar": ("[recording\n", "not valid TOML: "),
    "key": ("[recording]\nsplit_sec = 60\n", "unknown key 'recording.split_sec': did you mean 'split_s'?"),
    "table": ("[recordings]\n", "unknown key 'recordings': did you mean 'recording'?"),
    "quotes": ('[recording]\nsplit_s = "60"\n', 'recording.split_s: found "60", expected a number'),
    "range": ("[recording]\nqueue_mib = 0\n", "recording.queue_mib: found 0, expected a whole number >= 1"),
    "chunk": (
        "[recording]\nchunk_kib = 4096\n",
        "recording.chunk_kib: found 4096, expected a whole number <= 1024",
    ),
    "choice": (
        '[recording]\ncompression = "gzip"\n',
        'recording.compression: found "gzip", expected one of "none", "lz4", "zstd"',
    ),
    "driver": (
        '[sensors.lidar]\ndriver = "velodyne"\n',
        "sensors.lidar.driver: unknown driver 'velodyne': known here: gopro, livox, reach",
    ),
    "setting": (
        '[sensors.livox]\nadress = "192.168.1.3"\n',
        "unknown key 'sensors.livox.adress': did you mean 'address'?",
    ),
    "mode": (
        '[sensors.gopro]\nmode = "bluetooth"\n',
        'sensors.gopro.mode: found "bluetooth", expected one of "wifi", "usb"',
    ),
    "endpoint": ('[sensors.reach]\nendpoint = "usb"\n', "sensors.reach: "),
    "port": ("[live]\nport = 70000\n", "live.port: found 70000, expected a whole number <= 65535"),
    "topics": ('[topics]\nimu = "/livox/lidar"\n', "/livox/lidar"),
    "calibration": (
        'calibration = "/nowhere/calibration.toml"\n',
        "calibration: /nowhere/calibration.toml: no such file",
    ),
    "socket": ('[control]\nsocket = "/proc/control.sock"\n', "cannot listen at /proc/control.sock"),
    "group": ('[control]\nsocket = "{folder}/control.sock"\ngroup = "nobodys"\n', "control.group: no group 'nobodys'"),
    "bytes": ("calibration = '\xff'\n".encode("latin-1"), "byte 15 is not UTF-8; save the file as UTF-8"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_told_and_nothing_starts(tmp_path, monkeypatch, capsys, figures, name):
    monkeypatch.setattr("edge.cli.main._set_up_logging", lambda _verbose: None)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    text, words = BROKEN[name]
    path = tmp_path / "mapforest.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.replace("{folder}", str(tmp_path)).encode())
    assert main(["recorder", "--config", str(path)]) == exit_codes.FAILED
    said = capsys.readouterr().err
    figures("exit 1", said.strip().replace(str(tmp_path), ""))
    assert said.startswith("mapforest: ")
    assert words in said
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_file_is_told_by_the_program_itself(tmp_path):
    command = [sys.executable, "-m", "edge.cli.main", "recorder", "--config", str(tmp_path / "gone.toml")]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ended.returncode == exit_codes.FAILED
    assert ended.stderr.endswith("gone.toml: no such configuration file; leave --config out to use the defaults\n")
    assert ended.stdout == ""
