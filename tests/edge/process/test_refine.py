"""A processed session is refined beside its first products, and no stage is done twice."""

from __future__ import annotations

import json

import msgspec
import pytest

pytest.importorskip("gtsam", reason="GTSAM has no wheel for this Python")
pytest.importorskip("small_gicp", reason="small_gicp is not installed")

from edge.config import Config
from edge.errors import FormatError
from edge.process.process import Task
from edge.process.refine import refine
from tests.edge.process.test_process import StraightOn, fakes


class Striding(StraightOn):
    """Walks 3 m a sweep, so that eight sweeps are some keyframes."""

    def process(self, sweep):
        for one in super().process(sweep) or ():
            estimate = one.estimate
            far = 30.0 * estimate.travelled_m
            moved = {"position_m": 30.0 * estimate.position_m, "travelled_m": far}
            yield type(one)(type(estimate)(**{**_fields(estimate), **moved}), one.cloud)


def _fields(estimate):
    return {name: getattr(estimate, name) for name in estimate.__slots__}


def test_without_a_heading_the_refined_way_is_local_and_says_so_and_a_second_run_does_nothing(recording):
    task, config = Task([recording]), Config()
    done = refine(task, config, load=fakes(odometry=Striding))
    assert done.folder == recording.parent / "walk_products" / "refined"
    assert done.redone == ("odometry", "fusion", "products", "refined/refinement", "refined/moving", "refined/products")
    assert (done.facts.frame, done.facts.crs, done.facts.datum) == ("local", "local", None)
    assert any("no coordinate system is named" in note for note in done.facts.notes)
    made = {path.name for path in done.folder.iterdir()}
    assert made >= {"refinement.json", "refinement.html", "closures.csv", "trajectory_local.tum", "map_local.laz"}
    told = json.loads((done.folder / "refinement.json").read_text())
    assert (told["recording"][0][0], told["config"]["gnss"]["kernel"]) == ("walk.mcap", "huber")
    assert refine(task, config, load=None).redone == ()
    closures = msgspec.structs.replace(config.refinement.closures, enabled=False)
    changed = msgspec.structs.replace(config, refinement=msgspec.structs.replace(config.refinement, closures=closures))
    assert refine(task, changed, load=None).redone == ("refined/refinement", "refined/moving", "refined/products")


def test_constraints_that_cannot_be_met_are_named(recording):
    task = Task([recording])
    folder = recording.parent / "walk_products" / "refined"
    folder.mkdir(parents=True)
    (folder / "constraints.toml").write_text("[[drop_gnss]]\nfrom_s = 5\n")
    with pytest.raises(FormatError, match="missing required field `to_s`"):
        refine(task, Config(), load=fakes(odometry=Striding))
