"""The demonstration's services are set up, brought up, told when they fail, and ended politely."""

from __future__ import annotations

import importlib

import pytest

from drivers.sim.scenarios import scenario
from edge import demo
from edge.config import load
from edge.errors import EdgeError
from edge.paths import control_socket
from tests.waiting import wait_for


def test_the_demonstration_configures_a_recorder_on_loopback(tmp_path):
    stage = demo.Stage(tmp_path)
    demo.prepare(stage, demo.payload_config(stage, scenario("demo")))
    config = load(stage.config)
    assert set(config.sensors) == {"livox", "reach", "gopro"}
    assert config.recording.folder == str(tmp_path / "recordings")
    assert control_socket(config) == stage.socket


@pytest.mark.parametrize("there", [True, False])
def test_it_detects_where_the_model_and_its_runtime_are_installed(tmp_path, monkeypatch, there):
    model = tmp_path / "ailanthus-demo.onnx"
    monkeypatch.setattr(demo, "DEMO_MODEL", model)
    monkeypatch.setattr(demo, "find_spec", lambda _name: object())
    if there:
        model.touch()
    stage = demo.Stage(tmp_path)
    demo.prepare(stage, demo.payload_config(stage, scenario("demo")))
    assert load(stage.config).detection.model == ("demo" if there else "")


@pytest.fixture
def stage(tmp_path):
    """Without sensors: they would be anybody's who emulates some on this machine."""
    stage = demo.Stage(tmp_path)
    limits = "min_free_mib = 0\nmin_free_percent = 0"
    stage.config.write_text(
        f'[recording]\nfolder = "{tmp_path}/recordings"\n{limits}\n[control]\nsocket = "{stage.socket}"\n[sensors]\n'
    )
    return stage


def test_recorder_and_pipeline_come_up_know_each_other_and_end_politely(stage):
    with demo.recorder(stage) as client:
        with demo.pipeline(stage) as process:
            demo.wait_for_pipeline(stage, process, client)
            location = client.status().location
        assert process.returncode == 0
    assert location is not None
    assert location.state == "starting"
    assert "live pipeline ends; messages lost on the bus: none" in stage.log("pipeline").read_text()


def test_the_live_detector_is_up_beside_the_odometry(stage, tmp_path):
    pytest.importorskip("onnxruntime", reason="the detector's runtime is an extra")
    pytest.importorskip("onnx", reason="models for tests are built with onnx")
    models = importlib.import_module("tests.pipeline.detection.models")
    model = models.spotter(tmp_path / "spot.onnx")
    stage.config.write_text(f'{stage.config.read_text()}[detection]\nmodel = "{model}"\n')
    with demo.recorder(stage) as client, demo.pipeline(stage) as process:
        demo.wait_for_pipeline(stage, process, client)
        wait_for(lambda: (told := client.status().detecting) is not None and told.state == "waiting")
        detecting = client.status().detecting
    assert detecting is not None
    assert (detecting.model, detecting.device, detecting.note) == ("spot", "cpu", "no video from the camera")


def test_a_pipeline_that_ends_at_once_is_told_with_its_words(stage):
    stage.config.write_text(stage.config.read_text() + "[bus]\nenabled = false\n")
    with demo.recorder(stage) as client, demo.pipeline(stage) as process:
        process.wait()
        with pytest.raises(EdgeError, match=r"the pipeline ended at once(?s:.*)bus\.enabled is false"):
            demo.wait_for_pipeline(stage, process, client)
