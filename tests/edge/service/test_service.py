"""The whole recorder, with sensors on command."""

import json
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

from drivers.driver import SensorState
from drivers.messages import FixQuality, GnssFix
from edge.control.client import ControlClient
from edge.control.messages import Reply, Request
from edge.errors import ControlError, RecordingError
from edge.service.judge import Judge
from edge.service.notify import Notifier
from edge.service.service import Service
from edge.service.supervisor import Plan
from tests.edge.service.fakes import FakeDriver, config, imu, running
from tests.waiting import PATIENCE_S, wait_for

VERDICT = 'import json; print(json.dumps({"verdict": "WARN", "reasons": ["no scan"]}))'
FIX = GnssFix(
    stamp_ns=0,
    receive_ns=0,
    utc_ns=0,
    date_assumed=False,
    quality=FixQuality.RTK_FLOAT,
    latitude_deg=48.0,
    longitude_deg=11.0,
    height_m=500.0,
    geoid_separation_m=47.0,
    satellites=14,
    hdop=0.8,
    age_s=1.0,
    sigma_enu_m=(0.3, 0.4, 0.9),
    sigma_source="gst",
)


class FakeNotifier(Notifier):
    """Counts what systemd would get."""

    def __init__(self) -> None:
        super().__init__({})
        self.pings = 0

    def ping(self) -> None:
        self.pings += 1


@pytest.fixture
def driver() -> FakeDriver:
    return FakeDriver()


@pytest.fixture
def notifier() -> FakeNotifier:
    return FakeNotifier()


@pytest.fixture
def service(tmp_path: Path, driver: FakeDriver, notifier: FakeNotifier) -> Service:
    judge = Judge("", lambda _folder: [sys.executable, "-c", VERDICT])
    plans = [Plan("fake", lambda: driver)]
    return Service(config(tmp_path), plans=plans, judge=judge, notifier=notifier)


@pytest.fixture
def client(service: Service, driver: FakeDriver, tmp_path: Path) -> Iterator[ControlClient]:
    with running(service, tmp_path / "control.sock") as connected:
        assert driver.running.wait(PATIENCE_S)
        yield connected


def counts(reply: Reply) -> dict[str, int]:
    """Messages by topic in the files of a session, read by the mcap library."""
    found: dict[str, int] = {}
    for path in Path(reply.folder).glob("*.mcap"):
        with path.open("rb") as file:
            for _, channel, _ in make_reader(file).iter_messages():
                found[channel.topic] = found.get(channel.topic, 0) + 1
    return found


def test_what_is_emitted_between_start_and_stop_is_in_the_file(client: ControlClient, driver: FakeDriver) -> None:
    assert driver.emit is not None
    driver.emit(imu(1))
    started = client.request(Request("start", mission="plot 7", operator="ada"))
    for stamp in range(10):
        driver.emit(imu(started.id + stamp))
    client.request(Request("mark", text="here"))
    stopped = client.request(Request("stop"))
    driver.emit(imu(2))
    assert stopped.session == started.session
    assert stopped.session.endswith("plot-7")
    assert counts(stopped)["/livox/imu"] == 10
    assert counts(stopped)["/events"] == 1
    about = json.loads((Path(stopped.folder) / "session.json").read_text())["about"]
    assert (about["operator"], about["carrier"]) == ("ada", "handheld")
    assert "[recording]" in about["config_toml"]
    assert driver.told == ["started", "stopped"]


def test_start_and_stop_are_idempotent(client: ControlClient) -> None:
    assert client.request(Request("stop")).session == ""
    first = client.request(Request("start"))
    again = client.request(Request("start", mission="another"))
    assert again.session == first.session
    with pytest.raises(ControlError, match="session 'other' is not being recorded"):
        client.request(Request("stop", session="other"))
    assert client.status().state == "recording"
    assert client.request(Request("stop", session=first.session)).session == first.session
    assert client.request(Request("stop", session=first.session)).session == first.session
    assert client.status().state == "idle"
    assert client.request(Request("start")).session != first.session


def test_marking_and_validating_need_something_to_do_it_to(client: ControlClient) -> None:
    with pytest.raises(ControlError, match="nothing is being recorded"):
        client.request(Request("mark", text="here"))
    with pytest.raises(ControlError, match="nothing was recorded"):
        client.request(Request("validate"))
    with pytest.raises(ControlError, match="no such session"):
        client.request(Request("validate", session="../../etc"))
    client.request(Request("start"))
    with pytest.raises(ControlError, match="stop it first"):
        client.request(Request("validate"))


def test_after_a_stop_the_verdict_comes_into_status_and_session(client: ControlClient) -> None:
    client.request(Request("start"))
    stopped = client.request(Request("stop"))
    wait_for(lambda: (verdict := client.status().verdict) and not verdict.running)
    verdict = client.status().verdict
    assert verdict is not None
    assert (verdict.session, verdict.verdict, verdict.reasons) == (stopped.session, "WARN", ("no scan",))
    record = json.loads((Path(stopped.folder) / "session.json").read_text())
    assert record["verdict"] == {"verdict": "WARN", "reasons": ["no scan"]}


def test_the_status_shows_sensors_fix_recording_and_diagnostics_are_recorded(
    client: ControlClient, driver: FakeDriver
) -> None:
    assert driver.emit is not None
    driver.emit(FIX)
    driver.state = SensorState.DEGRADED
    client.request(Request("start", mission="walk"))
    states = client.subscribe()
    status = next(status for status in states if status.sensors[0].state == "degraded")
    assert status.gnss is not None
    assert (status.gnss.quality_name, status.gnss.sigma_horizontal_m) == ("RTK float", 0.5)
    assert status.recording is not None
    assert status.recording.mission == "walk"
    assert status.host.disk_free_bytes > 0
    stopped = client.request(Request("stop"))
    assert counts(stopped)["/diagnostics"] >= 1


def test_recording_goes_on_when_a_driver_dies(client: ControlClient, driver: FakeDriver) -> None:
    client.request(Request("start"))
    driver.crash.set()
    wait_for(lambda: client.status().sensors[0].state == "failed")
    status = client.status()
    assert "a bug" in status.sensors[0].problem
    assert status.state == "recording"
    assert counts(client.request(Request("stop")))["/events"] == 1


def test_the_watchdog_is_fed_only_while_the_writer_gets_on(service: Service, notifier: FakeNotifier) -> None:
    service._recorder.repaired.set()
    service.handle(Request("start"), 0)
    status = service._recorder.session_status
    assert status is not None
    service.tick(status.last_progress_ns)
    assert notifier.pings == 1
    service.tick(status.last_progress_ns + 3_600_000_000_000)
    assert notifier.pings == 1
    stalled = service._health.status(status.last_progress_ns + 4_000_000_000)
    assert any("taken no data for" in problem for problem in stalled.problems)
    service.handle(Request("stop"), 0)
    service.tick(status.last_progress_ns + 7_200_000_000_000)
    assert notifier.pings == 2


def test_the_watchdog_is_not_fed_when_all_receivers_stand_still(service: Service, driver: FakeDriver) -> None:
    driver.expected_hz = 200.0
    health = service._health
    service._supervisor.start()
    assert driver.running.wait(PATIENCE_S)
    health.look(10**18)
    assert health.alive
    status = health.status(10**18)
    health.look(10**18 + 60 * 10**9)
    assert not health.alive
    status = health.status(10**18)
    assert status.sensors[0].state == "failed"
    assert "stands still" in status.sensors[0].problem
    assert driver.emit is not None
    driver.emit(imu(3))
    health.look(10**18 + 61 * 10**9)
    assert health.alive
    service._supervisor.stop()


def test_a_full_card_is_told_before_a_start_and_refused_at_it(tmp_path: Path) -> None:
    full = config(tmp_path)
    recording = msgspec.structs.replace(full.recording, min_free_mib=1 << 40)
    service = Service(msgspec.structs.replace(full, recording=recording), plans=[])
    assert any("must stay free" in problem for problem in service.status().problems)
    service._recorder.repaired.set()
    with pytest.raises(RecordingError, match="MiB free"):
        service.handle(Request("start"), 0)
    assert service.status().state == "idle"


def test_a_session_that_ends_by_itself_is_finished_and_told(service: Service, client: ControlClient) -> None:
    client.request(Request("start"))
    session = service._recorder._session
    assert session is not None
    session._writer.ended = "disk reserve reached"  # type: ignore[attr-defined]
    wait_for(lambda: client.status().state == "idle")
    assert any("disk reserve reached" in problem for problem in client.status().problems)


def test_leftovers_of_a_power_cut_are_repaired_at_the_start(tmp_path: Path, service: Service) -> None:
    service._recorder.repaired.set()
    service.handle(Request("start"), 0)
    folder = Path(service.handle(Request("stop"), 0).folder)
    (split,) = folder.glob("*.mcap")
    data = split.read_bytes()
    split.unlink()
    split.with_suffix(".mcap.active").write_bytes(data[: len(data) - 40])
    with running(Service(config(tmp_path), plans=[]), tmp_path / "control.sock") as client:
        wait_for(split.exists)
        wait_for(lambda: client.status().problems)
        assert f"session {folder.name} was cut off (power or kill) and repaired" in client.status().problems[0]
        client.request(Request("start"))
        assert client.status().problems == ()


def test_the_watchdog_is_fed_while_a_slow_card_finishes_the_last_session(
    service: Service, notifier: FakeNotifier, monkeypatch: pytest.MonkeyPatch
) -> None:
    service._recorder.repaired.set()
    service.handle(Request("start"), 0)
    finish = service._recorder.stop
    monkeypatch.setattr("edge.service.service.TICK_S", 0.01)
    monkeypatch.setattr("edge.service.service.LOOK_NS", 1)

    def stop_slowly(reason: str) -> None:
        wait_for(lambda: notifier.pings >= 3)
        finish(reason)

    service._recorder.stop = stop_slowly  # type: ignore[method-assign]
    service._shut_down()
    assert notifier.pings >= 3
    assert service._recorder.state == "idle"


def test_a_second_recorder_is_refused(client: ControlClient, tmp_path: Path) -> None:
    with pytest.raises(ControlError, match="another recorder is running"):
        Service(config(tmp_path), plans=[]).run(threading.Event())
