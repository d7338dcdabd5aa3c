"""Drivers that die come back, and never take anything with them."""

from collections.abc import Iterator

import pytest

from drivers.driver import SensorState
from drivers.messages import Message, SensorEvent
from edge.service.supervisor import Plan, Supervisor
from tests.edge.service.fakes import FakeDriver, imu
from tests.waiting import wait_for


class Workshop:
    """Builds fake drivers and keeps them."""

    def __init__(self) -> None:
        self.built: list[FakeDriver] = []
        self.refuse = 0

    def build(self) -> FakeDriver:
        if self.refuse:
            self.refuse -= 1
            raise ImportError("no such module")
        self.built.append(FakeDriver())
        return self.built[-1]


@pytest.fixture
def workshop() -> Workshop:
    return Workshop()


@pytest.fixture
def taken() -> list[Message]:
    return []


@pytest.fixture
def supervisor(workshop: Workshop, taken: list[Message]) -> Iterator[Supervisor]:
    one = Supervisor([Plan("fake", workshop.build)], taken.append, backoff_s=(0.0,))
    one.start()
    yield one
    one.stop()


def wait_built(workshop: Workshop, count: int) -> FakeDriver:
    wait_for(lambda: len(workshop.built) >= count and workshop.built[count - 1].running.is_set())
    return workshop.built[count - 1]


def test_messages_are_handed_on_and_counted(supervisor: Supervisor, workshop: Workshop, taken: list[Message]) -> None:
    driver = wait_built(workshop, 1)
    assert driver.emit is not None
    driver.emit(imu(5))
    assert taken == [imu(5)]
    assert supervisor.runners[0].received == 1
    assert supervisor.health()[0].state is SensorState.OK


def test_a_driver_that_dies_is_built_anew_and_told_of_the_session(
    supervisor: Supervisor, workshop: Workshop, taken: list[Message]
) -> None:
    first = wait_built(workshop, 1)
    supervisor.session_started()
    first.crash.set()
    second = wait_built(workshop, 2)
    assert first.told == ["started"]
    wait_for(lambda: second.told == ["started"])
    supervisor.session_stopped()
    assert second.told == ["started", "stopped"]
    (event,) = taken
    assert isinstance(event, SensorEvent)
    assert event.text == "its driver died: RuntimeError('a bug')"


def test_a_driver_that_cannot_be_built_is_tried_again(workshop: Workshop) -> None:
    workshop.refuse = 3
    supervisor = Supervisor([Plan("fake", workshop.build)], lambda _message: None, backoff_s=(0.0,))
    supervisor.start()
    wait_built(workshop, 1)
    supervisor.stop()


def test_while_a_driver_is_down_its_health_is_red(workshop: Workshop) -> None:
    workshop.refuse = 1
    supervisor = Supervisor([Plan("fake", workshop.build)], lambda _message: None, backoff_s=(60.0,))
    assert supervisor.health()[0].state is SensorState.SEARCHING
    supervisor.start()
    wait_for(lambda: supervisor.health()[0].state is SensorState.FAILED)
    assert "no such module" in supervisor.health()[0].problem
    supervisor.stop()


def test_a_broken_health_is_told_not_raised(supervisor: Supervisor, workshop: Workshop) -> None:
    wait_built(workshop, 1).health_error = KeyError("temperature")
    health = supervisor.health()[0]
    assert health.state is SensorState.FAILED
    assert "KeyError('temperature')" in health.problem
