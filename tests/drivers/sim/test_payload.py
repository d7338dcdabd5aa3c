import json
import random
import socket
import time

import pytest

from drivers.errors import SimulationError
from drivers.registry import config_type
from drivers.sim.payload import Payload, PayloadConfig
from tests.waiting import PATIENCE_S, wait_for


@pytest.fixture
def address():
    return f"127.{random.randrange(2, 250)}.{random.randrange(1, 250)}.20", 9001


def answers(address):
    """Whether a receiver speaks NMEA there."""
    try:
        with socket.create_connection(address, timeout=PATIENCE_S) as link, link.makefile("rb") as lines:
            return lines.readline().startswith(b"$GN")
    except ConnectionError:
        return False


def test_an_emulator_that_was_killed_comes_back_into_the_same_walk(tmp_path, address):
    config = PayloadConfig(sensors=("reach",), reach_address=address, truth=tmp_path)
    with Payload(config) as payload:
        epoch_ns = payload.epoch_ns
        wait_for(lambda: answers(address))
        payload.processes["reach"].kill()
        wait_for(lambda: not payload.processes["reach"].is_alive())
        payload.restart("reach")
        wait_for(lambda: answers(address))
        assert payload.epoch_ns == epoch_ns
    assert not payload.processes["reach"].is_alive()
    assert (tmp_path / "poses.tum").exists()
    assert json.loads((tmp_path / "world.json").read_text())["name"] == "demo"


def test_the_walk_begins_when_it_is_let_go_and_never_when_that_fails(address):
    config = PayloadConfig(sensors=("reach",), reach_address=address)
    held_ns = []
    with Payload(config, lambda: held_ns.append(time.monotonic_ns())) as payload:
        assert len(held_ns) == 1
        assert payload.epoch_ns > held_ns[0]

    def fail():
        raise OSError("nobody is there")

    payload = Payload(config, fail)
    with pytest.raises(OSError, match="nobody is there"), payload:
        pass
    assert not payload.processes["reach"].is_alive()
    assert payload.epoch_ns == 0


def test_the_tables_are_configurations_of_the_drivers():
    for name, table in PayloadConfig().driver_tables().items():
        settings = {key: value for key, value in table.items() if key != "driver"}
        assert config_type(table["driver"])(**settings) is not None
        assert any(str(value).startswith(("127.", "tcp:127.")) for value in settings.values()), name


def test_unknown_errors_of_the_receiver_are_refused():
    with pytest.raises(SimulationError, match="honest"):
        Payload(PayloadConfig(gnss="perfect"))


def test_an_emulator_that_cannot_start_is_told(address):
    with (
        socket.create_server(address),
        Payload(PayloadConfig(sensors=("reach",), reach_address=address)) as payload,
    ):
        wait_for(lambda: not payload.processes["reach"].is_alive())
        with pytest.raises(SimulationError, match="ended with code"):
            payload.check()
