"""The card is full, nearly full, of a file system with small files, or pauses for seven seconds."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.reliability.chain import Chain
from tests.reliability.session import Session
from tests.reliability.sources import missing
from tests.waiting import wait_for

pytestmark = pytest.mark.slow
CARD_MIB = 24


def small_card(place: Path) -> list[str]:
    """A launcher that mounts a small file system at `place`, for the process it runs alone."""
    place.mkdir()
    script = f'mount -t tmpfs -o size={CARD_MIB}m tmpfs "{place}" && exec "$@"'
    launcher = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script, "sh"]
    if shutil.which("unshare") is None or subprocess.run([*launcher, "true"], check=False).returncode:
        pytest.skip("no file system can be mounted here")
    return launcher


def inside(chain: Chain, folder: Path) -> Path:
    """A path as the recorder's process sees it."""
    assert chain.recorder is not None
    return Path(f"/proc/{chain.recorder.pid}/root{folder}")


def ended(chain: Chain) -> bool:
    return chain.status is not None and chain.status.state == "idle"


@pytest.mark.parametrize("reserve_mib", [8, 0], ids=["reserve", "full"])
def test_a_full_card_ends_the_recording_and_keeps_what_is_there(tmp_path, figures, reserve_mib):
    launcher = small_card(tmp_path / "recordings")
    with Chain(tmp_path, recording={"min_free_mib": reserve_mib}, launcher=launcher) as chain:
        chain.until_delivering()
        folder = chain.start()
        wait_for(lambda: chain.status and chain.status.state == "recording")
        wait_for(lambda: ended(chain))
        words = chain.until_told("disk reserve reached" if reserve_mib else "cannot be written")
        chain.until_verdict()
        copy = tmp_path / "copy" / folder.name
        shutil.copytree(inside(chain, folder), copy)
        shutil.rmtree(inside(chain, folder))
        again = chain.start()
        chain.until_more(5)
        chain.stop()
        assert again != folder
        chain.stop_recorder()
    session = Session(copy)
    record = session.record
    gone = record["not_kept"] + sum(drops["count"] for drops in record["dropped"].values())
    figures(f"{record['messages']} messages kept, {gone} not; {record['bytes_written'] / 1e6:.1f} MB", words)
    assert record["state"] == "finished"
    assert session.partial == session.doubled == []
    assert record["bytes_written"] > (CARD_MIB - reserve_mib - 6) << 20
    if reserve_mib:
        assert gone == 0
        assert any("disk reserve reached" in text for text in session.told("disk"))
    else:
        assert record["error"]


def test_a_file_that_may_grow_no_further_is_kept_and_repaired_at_the_next_start(tmp_path, figures):
    """The system refuses in the middle of a write, and leaves no room for an index either."""
    if shutil.which("prlimit") is None:
        pytest.skip("no prlimit here")
    with Chain(tmp_path, launcher=["prlimit", f"--fsize={12 << 20}:"]) as chain:
        chain.until_delivering()
        folder = chain.start()
        wait_for(lambda: chain.status and chain.status.state == "recording")
        wait_for(lambda: ended(chain))
        words = chain.until_told("cannot be written")
        again = chain.start()
        chain.until_more(5)
        chain.stop()
        chain.stop_recorder()
        chain.launcher = []
        chain.start_recorder()
        wait_for(lambda: not list(folder.glob("*.active")) and (folder / "metadata.yaml").exists())
    session = Session(folder)
    assert session.partial == session.doubled == []
    assert sum(path.stat().st_size for path in folder.glob("*.mcap")) > 10 << 20
    assert Session(again).record["state"] == "finished"
    figures(f"{session.record['messages']} messages kept; what came after the refused write is lost", words)


def test_a_card_that_pauses_for_seven_seconds_costs_nothing(tmp_path, figures):
    with Chain(tmp_path, faulty=True) as chain:
        chain.until_delivering()
        folder = chain.start()
        chain.until_more(10)
        (tmp_path / "stall").write_text("7")
        words = chain.until_told("the card has taken no data")
        chain.until_more(80, "livox")
        chain.stop()
        verdict, reasons = chain.until_verdict()
        skipped = chain.truth("livox")["skipped"]
    session = Session(folder)
    record = session.record
    lost = missing(np.array(list(session.packets))) + missing(session.samples)
    figures(f"{lost} packets; longest flush {record['flush_worst_ms'] / 1e3:.1f} s, verdict {verdict} {reasons}", words)
    assert record["flush_worst_ms"] >= 7000
    assert record["dropped"] == {}
    assert record["not_kept"] == 0
    assert session.doubled == session.partial == []
    assert lost == session.counted("livox", "kernel drops") or skipped
