"""The configuration file: what is accepted, and what a mistake is answered with."""

from pathlib import Path
from typing import Literal

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import registry
from edge import toml_table
from edge.config import Config, load, sensor_settings, to_toml
from edge.errors import ConfigError

SAMPLE = Path(__file__).parents[2] / "edge" / "mapforest.toml"


class FakeSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Settings of a made-up sensor."""

    address: str = "127.0.0.9"
    rate_hz: float = 5.0
    mode: Literal["fast", "slow"] = "fast"
    battery: float | None = None


@pytest.fixture
def real_drivers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()


@pytest.fixture(autouse=True)
def fake_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "DRIVERS", {"fake": ("x:y", "x:z"), "other": ("x:y", "x:z")})
    monkeypatch.setattr(registry, "config_type", lambda _driver: FakeSettings)


def refused(folder: Path, text: str) -> str:
    path = folder / "mapforest.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    return message.removeprefix(str(path))


def test_no_file_means_defaults() -> None:
    assert load(None) == Config()


def test_an_empty_file_means_defaults_but_its_own_sensors_replace_the_default_ones(tmp_path: Path) -> None:
    path = tmp_path / "one.toml"
    path.write_text('[sensors.gnss]\ndriver = "fake"\nrate_hz = 10\n[recording]\nsplit_s = 30\n')
    config = load(path)
    assert list(config.sensors) == ["gnss"]
    assert config.recording.split_s == 30.0
    assert sensor_settings(config, "gnss") == FakeSettings(rate_hz=10.0)


def test_the_driver_is_the_name_of_the_table_when_not_said(tmp_path: Path) -> None:
    path = tmp_path / "one.toml"
    path.write_text("[sensors.fake]\n")
    assert sensor_settings(load(path), "fake") == FakeSettings()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[recording]\nsplit_sec = 3", ": unknown key 'recording.split_sec': did you mean 'split_s'? known here: "),
        ("[recordings]\n", ": unknown key 'recordings': did you mean 'recording'? known here: "),
        ("[recording]\nsplit_mib = true", ": recording.split_mib: found true, expected a whole number"),
        ("[recording]\nsplit_s = true", ": recording.split_s: found true, expected a number"),
        ('[recording]\nsplit_s = "60"', ': recording.split_s: found "60", expected a number'),
        ("[recording]\nsplit_mib = 1.5", ": recording.split_mib: found 1.5, expected a whole number"),
        ("[recording]\nsplit_s = 0", ": recording.split_s: found 0, expected a number > 0"),
        (
            '[recording]\ncompression = "gzip"',
            ': recording.compression: found "gzip", expected one of "none", "lz4", "zstd"',
        ),
        ("recording = 3", ": recording: found 3, expected a table"),
        ("[live.port]\nx = 1", ": live.port: found a table, expected a whole number"),
        (
            '[validation.topics."/my/topic"]\nrate = 1.0',
            ": unknown key 'validation.topics.\"/my/topic\".rate': did you mean 'rate_hz'? known here: ",
        ),
        ("[validation.topics.a]\ntolerance = 0.2", ": validation.topics.a.rate_hz is missing; it has no default"),
        ("[sensors]\nlivox = 1", ": sensors.livox: found 1, expected a table"),
        (
            '[sensors.a]\ndriver = "fakee"',
            ": sensors.a.driver: unknown driver 'fakee': did you mean 'fake'? known here: fake, other",
        ),
        ("[sensors.a]\ndriver = 3", ": sensors.a.driver: found 3, expected a text in quotes"),
        (
            '[sensors.a]\ndriver = "fake"\nadress = "x"',
            ": unknown key 'sensors.a.adress': did you mean 'address'? known here: address, battery, mode, rate_hz",
        ),
        ('[sensors.a]\ndriver = "fake"\nrate_hz = false', ": sensors.a.rate_hz: found false, expected a number"),
        (
            '[sensors.fake]\nmode = "idle"',
            ': sensors.fake.mode: found "idle", expected one of "fast", "slow"',
        ),
        ("[sensors.fake]\nbattery = []", ": sensors.fake.battery: found [], expected a number or nothing"),
    ],
)
def test_a_mistake_is_named_with_key_found_and_expected(tmp_path: Path, text: str, message: str) -> None:
    assert refused(tmp_path, text).startswith(message)


def test_broken_toml_names_the_line(tmp_path: Path) -> None:
    assert "line 2" in refused(tmp_path, "[recording]\nsplit_s = = 3\n")


def test_a_missing_file_and_a_binary_file_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such configuration file"):
        load(tmp_path / "gone.toml")
    binary = tmp_path / "mapforest.toml"
    binary.write_bytes(b"calibration = '\xff'")
    with pytest.raises(ConfigError, match="byte 15 is not UTF-8"):
        load(binary)


def test_the_effective_configuration_reads_back_as_itself(tmp_path: Path) -> None:
    path = tmp_path / "mapforest.toml"
    path.write_text('[sensors."my gnss"]\ndriver = "fake"\n[validation.topics."/a b"]\nrate_hz = 2.0\n')
    config = load(path)
    again = tmp_path / "again.toml"
    again.write_text(to_toml(config), encoding="utf-8")
    assert 'mode = "fast"' in again.read_text()
    assert sensor_settings(load(again), "my gnss") == sensor_settings(config, "my gnss")
    assert load(again).validation == config.validation


def test_the_sample_file_says_every_key_and_every_default() -> None:
    raw = toml_table.read(SAMPLE)
    del raw["sensors"]
    assert toml_table.convert(raw, Config, str(SAMPLE)) == Config()
    # The estimators' settings are no operator's business: their own documents list them.
    known = {key for key in keys(msgspec.to_builtins(Config())) if key.split(".")[0] not in ESTIMATORS}
    assert keys(raw) == known - {"sensors"}


ESTIMATORS = ("odometry", "fusion", "grounding", "refinement", "inventory")


@pytest.mark.usefixtures("real_drivers")
@pytest.mark.parametrize("sensor", registry.DRIVERS)
def test_the_sample_file_says_what_the_drivers_do_by_default(sensor: str) -> None:
    config = Config(sensors=toml_table.read(SAMPLE)["sensors"])
    assert list(config.sensors) == list(registry.DRIVERS)
    assert sensor_settings(config, sensor) == registry.config_type(sensor)()


@pytest.mark.usefixtures("real_drivers")
def test_the_default_configuration_can_be_written_and_read_with_every_driver(tmp_path: Path) -> None:
    path = tmp_path / "effective.toml"
    path.write_text(to_toml(Config()), encoding="utf-8")
    again = load(path)
    assert all(sensor_settings(again, name) == sensor_settings(Config(), name) for name in Config().sensors)


def keys(table: dict, path: str = "") -> set[str]:
    found = set()
    for name, value in table.items():
        if name == "sensors":
            found.add(name)
        else:
            found |= {path + name} | (keys(value, f"{path}{name}.") if isinstance(value, dict) else set())
    return found


values = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@given(st.dictionaries(st.text(), values, max_size=4))
def test_any_table_survives_being_written_and_read(table: dict) -> None:
    assert toml_table.tomllib.loads(toml_table.render(table)) == table
