from drivers.sim.scenarios import scenario
from edge import demo
from edge.config import load
from edge.paths import control_socket


def test_the_demonstration_configures_a_recorder_on_loopback(tmp_path):
    stage = demo.Stage(tmp_path)
    demo.prepare(stage, demo.payload_config(stage, scenario("demo")))
    config = load(stage.config)
    assert set(config.sensors) == {"livox", "reach", "gopro"}
    assert config.recording.folder == str(tmp_path / "recordings")
    assert control_socket(config) == stage.socket
