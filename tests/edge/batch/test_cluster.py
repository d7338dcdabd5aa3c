"""Workers that are not fit are told apart, each with what to do."""

from __future__ import annotations

import pytest

pytest.importorskip("distributed", reason="the extra `cluster` is not installed")

import msgspec

from edge import __version__
from edge.batch import cluster
from edge.batch.worker import Look
from edge.errors import ClusterError

FIT = Look(__version__, 2, 8e9, 1, refine=True)


class Workers:
    """A client whose workers say this."""

    def __init__(self, *told, scheduler=__version__) -> None:
        self.version = scheduler
        self.told = {f"tcp://10.0.0.{number}:4000": one for number, one in enumerate(told)}
        self.scheduler = self
        self.address = "tcp://10.0.0.9:8786"

    def run_on_scheduler(self, function):
        if isinstance(self.version, Exception):
            raise self.version
        return self.version

    def wait_for_workers(self, count, timeout):
        if len(self.told) < count:
            raise TimeoutError

    def run(self, function, directory, on_error):
        assert on_error == "return"
        return self.told


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"version": "0.0.9"}, f"runs mapforest 0.0.9, and this is {__version__}: install the same one there"),
        ({"sessions": 0}, "does not see /data: mount it there at the same place"),
        ({"sessions": 1}, "sees 1 of the 2 sessions in /data: mount it"),
        ({"memory": 0.0}, "declares no memory; start it so: dask worker tcp://10.0.0.9:8786 --nworkers"),
        ({"threads": 8}, "has 8 threads, and needs one; start it so: dask worker"),
    ],
)
def test_an_unfit_worker_is_named_with_what_to_do(told, words, tmp_path):
    client = Workers(FIT, msgspec.structs.replace(FIT, **told))
    with pytest.raises(ClusterError) as caught:
        cluster.fit_workers(client, "/data", 2)
    assert str(caught.value).startswith(f"worker tcp://10.0.0.1:4000 {words}")


def test_a_worker_without_mapforest_says_what_is_missing():
    missing = Exception("ModuleNotFoundError(\"No module named 'edge'\")")
    with pytest.raises(
        ClusterError, match=r"cannot load mapforest .*'edge'.*: install mapforest .* with the extra `cluster`"
    ):
        cluster.fit_workers(Workers(missing), "/data", 2)
    with pytest.raises(ClusterError, match="cannot say what it sees: PermissionError"):
        cluster.fit_workers(Workers(PermissionError("no")), "/data", 2)


def test_the_scheduler_too_needs_mapforest_of_the_same_version():
    with pytest.raises(ClusterError, match=r"the scheduler at tcp://10.* runs mapforest 0\.0\.9, and this is"):
        cluster.fit_workers(Workers(FIT, scheduler="0.0.9"), "/data", 2)
    with pytest.raises(ClusterError, match=r"the scheduler at tcp://10.* cannot load mapforest \(No module"):
        cluster.fit_workers(Workers(FIT, scheduler=ModuleNotFoundError("No module named 'edge'")), "/data", 2)


def test_a_scheduler_without_workers_and_one_that_is_not_there_are_told(monkeypatch):
    assert cluster.fit_workers(Workers(FIT, FIT), "/data", 2) == [FIT, FIT]
    with pytest.raises(ClusterError, match="the scheduler has no workers; start some: dask worker"):
        cluster.fit_workers(Workers(), "/data", 2)
    monkeypatch.setattr(cluster, "WAIT_S", 0.1)
    for address in ("tcp://127.0.0.1:1", "nonsense://x"):
        with pytest.raises(ClusterError, match="no Dask scheduler answers there"), cluster.existing(address):
            pass
