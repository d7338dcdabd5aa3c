"""A recording becomes products, stage by stage, and no stage is done twice."""

from __future__ import annotations

import json
from dataclasses import dataclass

import laspy
import msgspec
import numpy as np
import pytest

from edge.cli.main import main
from edge.config import Config
from edge.errors import EdgeError
from edge.process import process as module
from edge.process.estimators import Estimators
from edge.process.process import Task, process
from edge.process.sweep_odometry import Tracked
from pipeline.estimates import GlobalPose, OdometryEstimate
from pipeline.gnss.geodesy import Datum

DATUM = Datum(47.0, 8.0, 500.0)


class StraightOn:
    """An odometry that walks east at 1 m/s and is not ready for the first sweep."""

    def __init__(self, config) -> None:
        self.config = config
        self.note = "not moving yet"
        self.sweeps = 0

    def process(self, sweep):
        self.sweeps += 1
        if self.sweeps == 1:
            return
        assert sweep.imu
        scan, at = sweep.scan, np.array([0.1 * self.sweeps, 0.0, 0.0])
        end_ns = scan.stamp_ns + int(scan.offset_ns.max())
        speed, zero = np.array([1.0, 0.0, 0.0]), np.zeros(3)
        far = 0.1 * self.sweeps
        estimate = OdometryEstimate(
            end_ns, at, np.eye(3), speed, np.eye(6) * 0.01, zero, zero, far, False, np.empty((0, 3)), 400, 350
        )

        yield Tracked(estimate, np.column_stack([scan.xyz_m + at, scan.reflectivity]).astype(np.float32))

    def flush(self):
        return ()


@dataclass
class Turned:
    """`odom` lies 10 m east of the datum, turned by a quarter."""

    datum: Datum = DATUM
    notes: tuple[str, ...] = ("the receiver is late",)

    def pose(self, estimate):
        x, y, z = estimate.position_m
        turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        return GlobalPose(estimate.stamp_ns, np.array([10.0 - y, x, z]), turn @ estimate.rotation, np.eye(6) * 0.04)


def fakes(*, smooth=lambda _odometry, _fixes, _config: Turned(), odometry=StraightOn):
    return lambda: Estimators(odometry, smooth, None)


def test_everything_is_made_and_georeferenced(recording):
    done = process(Task([recording]), Config(), load=fakes())
    assert done.folder == recording.parent / "walk_products"
    assert (done.facts.sweeps, done.facts.estimates, done.facts.frame) == (8, 7, "map")
    assert "1 sweeps without an estimate: not moving yet" in done.facts.notes
    assert {path.name for path in done.folder.iterdir()} - {"work"} == {*done.facts.files, "products.json"}
    lines = (done.folder / "trajectory.tum").read_text().splitlines()
    assert [float(word) for word in lines[0].split()[1:4]] == pytest.approx([10.0, 0.2, 0.0])
    cloud = laspy.read(done.folder / "map.laz")
    assert cloud.header.parse_crs().to_epsg() == 32632
    assert len(cloud.points) == done.facts.points > 300
    assert "<svg" in (done.folder / "trajectory.html").read_text()


def test_without_fixes_the_map_is_local_and_says_so(recording):
    done = process(Task([recording], gnss=False), Config(), load=fakes())
    assert (done.facts.frame, done.facts.crs) == ("odom", "local")
    assert any("not georeferenced" in note for note in done.facts.notes)
    assert not (done.folder / "map.laz").exists()
    text = laspy.read(done.folder / "map_local.laz").header.vlrs.get("Text Area Description")
    header = laspy.read(done.folder / "map_local.laz").header
    assert header.parse_crs() is None, text


def test_a_second_run_does_nothing_and_a_change_redoes_what_follows_from_it(recording):
    config = Config()
    assert process(Task([recording]), config, load=fakes()).redone == ("odometry", "fusion", "products")
    assert process(Task([recording]), config, load=None).redone == ()
    gate = msgspec.structs.replace(config, fusion=msgspec.structs.replace(config.fusion, gate=20.0))
    assert process(Task([recording]), gate, load=fakes()).redone == ("fusion", "products")
    (recording.parent / "walk_products" / "products.json").unlink()
    assert process(Task([recording]), gate, load=fakes()).redone == ("products",)
    assert process(Task([recording], gnss=False), gate, load=fakes()).redone == ("odometry", "fusion", "products")


def test_an_interrupted_run_goes_on_at_its_stage(recording):
    def power_cut(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        process(Task([recording]), Config(), load=fakes(smooth=power_cut))
    assert process(Task([recording]), Config(), load=fakes()).redone == ("fusion", "products")


def test_a_recording_that_gives_no_pose_is_an_error_with_the_reason(recording):
    class Never(StraightOn):
        def process(self, sweep):
            return ()

    with pytest.raises(EdgeError, match=r"no pose could be estimated from 8 sweeps: not moving yet \(8 times\)"):
        process(Task([recording]), Config(), load=fakes(odometry=Never))


def test_the_command_prints_json_and_ends_with_warnings_where_there_are_some(recording, capsys, monkeypatch):
    monkeypatch.setattr(module.process, "__defaults__", (None, fakes(smooth=lambda *_: None)))
    assert main(["process", str(recording), "--json"]) == 3
    told = json.loads(capsys.readouterr().out)
    assert (told["sweeps"], told["frame"], told["redone"]) == (8, "odom", ["odometry", "fusion", "products"])
    assert main(["process", str(recording), "--lidar-pose", "1,2"]) == 2
    assert "seven numbers are expected" in capsys.readouterr().err
