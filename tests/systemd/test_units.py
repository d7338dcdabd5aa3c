"""The units are checked with systemd's own tools; paths of the payload are replaced by ones that exist here."""

import shutil
import subprocess
from pathlib import Path

import pytest

SYSTEMD = Path(__file__).parents[2] / "systemd"
ANALYZE = shutil.which("systemd-analyze")
needs_systemd = pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")


@pytest.fixture
def units(tmp_path):
    for unit in SYSTEMD.glob("*.service"):
        text = unit.read_text().replace("/opt/mapforest/venv/bin/mapforest", "/bin/true")
        (tmp_path / unit.name.replace("@", "@tty1")).write_text(text)
    return sorted(tmp_path.glob("*.service"))


@needs_systemd
def test_systemd_finds_nothing_to_say_about_the_units(units):
    # `verify` warns on unknown keys and still exits 0: silence is the proof.
    done = subprocess.run([ANALYZE, "verify", *units], capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""


@needs_systemd
def test_exposure_of_the_recorder_is_at_most_two(units):
    unit = next(path for path in units if "recorder" in path.name)
    help_text = subprocess.run([ANALYZE, "--help"], capture_output=True, text=True, check=True).stdout
    if "--offline" not in help_text:
        pytest.skip("this systemd-analyze has no offline mode (250 or later has)")
    command = [ANALYZE, "security", "--offline=true", "--threshold=20", unit]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-300:]


def install(*arguments):
    script = SYSTEMD / "install.sh"
    return subprocess.run([script, *arguments], capture_output=True, text=True, check=False)


def tree(root):
    return {path.relative_to(root): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def test_installing_twice_changes_nothing_the_second_time(tmp_path):
    assert install("--root", tmp_path, "--recordings", "/mnt/card").returncode == 0
    first = tree(tmp_path)
    again = install("--root", tmp_path, "--recordings", "/mnt/card")
    assert tree(tmp_path) == first
    assert "+" not in again.stdout
    assert b'folder = "/mnt/card"' in first[Path("etc/mapforest/mapforest.toml")]
    drop_in = first[Path("etc/systemd/system/mapforest-recorder.service.d/recordings.conf")]
    assert b"ReadWritePaths=/mnt/card" in drop_in


def test_a_dry_run_touches_nothing(tmp_path):
    done = install("--root", tmp_path, "--dry-run")
    assert done.returncode == 0
    assert "+ install" in done.stdout
    assert tree(tmp_path) == {}


def test_uninstalling_keeps_the_configuration_and_the_recordings(tmp_path):
    install("--root", tmp_path)
    recording = tmp_path / "var/lib/mapforest/recordings/walk.mcap"
    recording.write_text("kept")
    assert install("--root", tmp_path, "--uninstall").returncode == 0
    left = {str(path) for path in tree(tmp_path)}
    assert left == {"etc/mapforest/mapforest.toml", "var/lib/mapforest/recordings/walk.mcap"}


@pytest.mark.parametrize("arguments", [("--nonsense",), ("--recordings", "relative/path")])
def test_wrong_usage_is_told(arguments):
    done = install(*arguments)
    assert done.returncode == 2
    assert "install.sh:" in done.stderr
