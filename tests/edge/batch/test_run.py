"""One real cluster: a session that kills its worker once, one that is broken, and the same products as one by one."""

from __future__ import annotations

import hashlib
import shutil

import pytest

pytest.importorskip("distributed", reason="the extra `cluster` is not installed")

from edge.batch.cluster import fit_workers, hush, local
from edge.batch.plan import MIB, plan
from edge.batch.run import Batch
from edge.batch.work import work
from edge.config import Config
from edge.errors import ClusterError
from edge.process import process as module
from edge.process.watch import Watch
from tests.edge.batch import on_worker
from tests.edge.process.test_process import fakes
from tests.edge.replay import foreign


class Heard:
    def __init__(self) -> None:
        self.told: list[tuple] = []

    def began(self, step, attempt):
        self.told.append((step.name, step.stage, attempt))

    def went_on(self, step, part, share):
        self.told.append((step.name, part))

    def finished(self, step, finished):
        self.told.append((step.name, "finished"))

    def failed(self, step, reason):
        self.told.append((step.name, "failed"))


def digests(folder):
    """Of the products that tell neither when they were made nor how long it took."""
    files = [path for path in folder.iterdir() if path.is_file() and path.suffix not in {".json", ".gpkg"}]
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files if path.name != "report.html"}


def test_a_batch_is_what_one_by_one_would_be_and_survives_a_killed_worker_and_a_broken_session(tmp_path, monkeypatch):
    sessions = [tmp_path / "batch" / name for name in ("broken", "killed", "sound")]
    for folder in sessions:
        folder.mkdir(parents=True)
        foreign.walk_with_fixes(folder / "walk_0.mcap")
    (sessions[0] / "walk_0.mcap").write_bytes(b"not a recording")
    (sessions[1] / on_worker.DIE).touch()
    alone = tmp_path / "alone" / "sound"
    shutil.copytree(sessions[2], alone)
    heard, plans = Heard(), [plan(session, refine=False) for session in sessions]
    hush()
    with local(2, 8192 * MIB) as client:
        assert [one.sessions for one in fit_workers(client, tmp_path / "batch", 3)] == [3, 3]
        with pytest.raises(
            ClusterError, match=r"worker tcp://127\.0\.0\.1:\d+ sees 3 of the 4 sessions in .*: mount it"
        ):
            fit_workers(client, tmp_path / "batch", 4)
        broken, killed, sound = Batch(client, Config(), heard, 4096 * MIB, on_worker.run).run(plans)
    assert "walk_0.mcap" in broken.failed["process"]
    assert not broken.done
    assert [list(one.done) for one in (killed, sound)] == [["process", "report"]] * 2
    assert sound.done["process"].redone == ("odometry", "fusion", "products")
    assert ("sound", "odometry") in heard.told
    monkeypatch.setattr(module.process, "__defaults__", (None, fakes()))
    again = [work(step, Config(), Watch()) for step in plan(sessions[2], refine=False)]
    assert [one.redone for one in again] == [(), ()]
    for step in plan(alone, refine=False):
        work(step, Config(), Watch())
    assert digests(alone / "products") == digests(sessions[2] / "products")
    assert {"map.laz", "trajectory.tum"} <= set(digests(alone / "products"))
    assert not (sessions[1] / on_worker.DIE).exists()
