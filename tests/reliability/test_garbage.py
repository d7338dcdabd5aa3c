"""Rubbish on every socket and port: nothing wrong is recorded, nothing ends."""

import contextlib
import random
import socket
import threading

import numpy as np
import pytest

from drivers.livox.config import Config as LivoxConfig
from edge.errors import ControlError
from tests.reliability.chain import SENSORS, Chain
from tests.reliability.session import Session
from tests.reliability.sources import missing
from tests.waiting import wait_for

pytestmark = [pytest.mark.slow, pytest.mark.timeout(400)]
PAUSE_S = 0.002


def checksum_holds(sentence: str) -> bool:
    body, _, given = sentence[1:].partition("*")
    value = 0
    for character in body.encode("latin-1"):
        value ^= character
    return f"{value:02X}" == given.upper()


def strangers(chain: Chain, stop: threading.Event) -> None:
    """Random datagrams to every port of the recorder, and of the sensors, from an address that is none of theirs."""
    chosen = random.Random(3)
    livox = LivoxConfig()
    ports = [livox.host_command_port, livox.host_status_port, livox.host_point_port, livox.host_imu_port]
    places = [(chain.host, port) for port in (*ports, chain.stream_port)]
    places += [(chain.addresses["livox"], port) for port in (56000, 56100)]
    places.append((chain.addresses["gopro"], chain.stream_port))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind((chain.host.rpartition(".")[0] + ".99", 0))
        while not stop.wait(PAUSE_S):
            with contextlib.suppress(OSError):
                sender.sendto(chosen.randbytes(chosen.randrange(1500)), chosen.choice(places))


def callers(chain: Chain, stop: threading.Event) -> None:
    """Random lines to the control socket, and connections that end in the middle of one."""
    chosen = random.Random(4)
    while not stop.wait(PAUSE_S * 10):
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
            caller.settimeout(1.0)
            caller.connect(str(chain.socket))
            caller.sendall(chosen.randbytes(chosen.randrange(1, 40_000)) + chosen.choice((b"", b"\n", b"\n{")))


@contextlib.contextmanager
def running(*bodies, of: Chain):
    stop = threading.Event()
    threads = [threading.Thread(target=body, args=(of, stop)) for body in bodies]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stop.set()
        for thread in threads:
            thread.join()


def test_garbage_everywhere_is_not_recorded(tmp_path, figures):
    with Chain(tmp_path, drivers={"gopro": {"record_on_camera": False}}) as chain:
        chain.until_delivering()
        folder = chain.start()
        for name, rate in (("livox", 200), ("reach", 2000), ("gopro", 50)):
            chain.fault(name, f"garbage={rate}")
        with running(strangers, callers, of=chain):
            chain.until_more(60)
            assert chain.request("mark", text="still answers").ok
            chain.until_more(60, "livox")
        chain.stop()
        verdict, reasons = chain.until_verdict()
        skipped = chain.truth("livox")["skipped"]
        log = chain.said()
    session = Session(folder)
    seen = session.counted("livox", "malformed packets") + session.counted("livox", "datagrams of others")
    lost_packets, lost_samples = missing(np.array(list(session.packets))), missing(session.samples)
    figures(
        f"{lost_packets} point packets, {lost_samples} inertial ones, {missing(session.frames)} frames, "
        f"{missing(session.epochs)} epochs; thrown away: {seen} datagrams at the LiDAR's ports, "
        f"{session.counted('gopro', 'rubbish')} at the camera's; {verdict}",
        [*chain.told, *reasons],
    )
    assert "Traceback" not in log
    assert session.doubled == session.partial == []
    assert lost_packets + lost_samples == session.counted("livox", "kernel drops") or skipped
    assert session.counted("gopro", "rubbish") > 0
    assert (np.diff(session.frames) > 0).all()
    assert missing(session.frames) == session.counted("gopro", "video.lost")
    assert all(map(checksum_holds, session.sentences))
    assert (np.diff(session.epochs) > 0).all()
    assert {fix.status for fix in session.fixes} == {2}
    assert any(event.text == "still answers" for event in session.events)


@pytest.mark.parametrize("name", SENSORS)
def test_damaged_bytes_are_dropped_or_stay_what_they_are(tmp_path, figures, name):
    """Bits flipped in one of twenty datagrams or sentences; UDP's own checksum is not there to help."""
    with Chain(tmp_path, [name]) as chain:
        chain.until_delivering()
        folder = chain.start()
        chain.fault(name, "corrupt=0.05")
        chain.until_more(80)
        chain.fault(name)
        chain.until_more(10)
        chain.stop()
        verdict, reasons = chain.until_verdict()
        assert "Traceback" not in chain.said()
    session = Session(folder)
    counts = {topic: len(messages) for topic, messages in session.topics.items()}
    figures(f"{counts}; {verdict}", [*chain.told, *reasons])
    assert all(map(checksum_holds, session.sentences))
    for topic in ("/livox/lidar", "/livox/imu", "/gnss/fix", "/camera/video"):
        assert (np.diff(session.stamps_ns(topic)) > 0).all(), topic


def test_clients_that_never_read_or_flood_hold_up_nobody(tmp_path, figures):
    with Chain(tmp_path) as chain:
        chain.until_delivering()
        folder = chain.start()
        with contextlib.ExitStack() as clients:
            deaf = [clients.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) for _ in range(10)]
            for one in deaf:
                one.connect(str(chain.socket))
                one.sendall(b'{"type":"request","command":"subscribe"}\n')
            with running(flood, of=chain):
                wait_for(lambda: "does not read" in chain.said())
                chain.until_more(30)
                assert chain.request("mark", text="in the flood").ok
        refused = asked_by_one_too_many(chain)
        chain.until_more(5)
        chain.stop()
        verdict, reasons = chain.until_verdict()
    session = Session(folder)
    figures(
        f"nothing; {verdict} {reasons}",
        [*[line for line in chain.said().splitlines() if "control:" in line][:2], refused],
    )
    assert "more than 32 clients" in refused
    assert session.record["dropped"] == {}
    assert session.doubled == session.partial == []
    assert any(event.text == "in the flood" for event in session.events)


def asked_by_one_too_many(chain: Chain) -> str:
    """The refusal, while forty others hold a connection."""
    with contextlib.ExitStack() as clients:
        for _ in range(40):
            clients.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)).connect(str(chain.socket))
        with pytest.raises(ControlError) as refused:
            chain.request("hello")
    return str(refused.value)


def flood(chain: Chain, stop: threading.Event) -> None:
    """Ask for the state as fast as the recorder takes it, and never read an answer."""
    question = b'{"type":"request","command":"status"}\n' * 100
    while not stop.is_set():
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
            caller.settimeout(0.5)
            caller.connect(str(chain.socket))
            while not stop.is_set():
                caller.sendall(question)
