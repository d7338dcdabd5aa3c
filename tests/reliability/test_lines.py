"""Datagrams that are lost, doubled or overtaken: everything is counted, nothing is recorded twice."""

import numpy as np
import pytest

from tests.reliability.chain import Chain
from tests.reliability.session import Session
from tests.reliability.sources import missing
from tests.waiting import wait_for

pytestmark = [pytest.mark.slow, pytest.mark.timeout(400)]
PACKETS = 300
NOT_ON_CARD = {"gopro": {"record_on_camera": False}}
"""Else the camera's shutter interrupts its own preview: frames that were never sent are no loss of the link."""


def recorded(chain: Chain, kind: str, *faults: str) -> Session:
    """A session in the middle of which these faults held, until they had hit PACKETS of the LiDAR."""
    chain.until_delivering()
    folder = chain.start()
    chain.until_more(20)
    for name in ("livox", "gopro"):
        chain.fault(name, *faults)
    wait_for(lambda: chain.truth("livox")["points"][kind] >= PACKETS)
    wait_for(lambda: chain.truth("livox")["imu"][kind] >= PACKETS // 20)
    for name in ("livox", "gopro"):
        chain.fault(name)
    chain.until_more(30)
    chain.stop()
    chain.until_verdict()
    return Session(folder)


def kept_up(chain: Chain) -> None:
    """Skip where the emulator itself left packets out: the numbers say nothing then."""
    if chain.truth("livox")["skipped"]:
        pytest.skip("this machine is too slow for the emulated LiDAR")


def kernel_drops(session: Session) -> int:
    """What the kernel threw away because the machine was busy; 0 on any that is not."""
    return session.counted("livox", "kernel drops")


def test_five_percent_loss_is_counted_exactly(tmp_path, figures):
    with Chain(tmp_path, drivers=NOT_ON_CARD) as chain:
        session = recorded(chain, "lost", "loss=0.05")
        truth = chain.truth("livox")
        kept_up(chain)
        verdict, reasons = chain.until_verdict()
    points, imu = truth["points"]["lost"], truth["imu"]["lost"]
    lost_packets, lost_samples = missing(np.array(list(session.packets))), missing(session.samples)
    lost_frames = missing(session.frames)
    figures(
        f"{lost_packets} of {points} lost point packets and {lost_samples} of {imu} lost inertial ones missing in the "
        f"file, {session.counted('livox', 'points.lost')} and {session.counted('livox', 'imu.lost')} counted; "
        f"{lost_frames} frames missing, {session.counted('gopro', 'video.lost')} counted; {verdict}",
        [*chain.told, *reasons],
    )
    assert lost_packets + lost_samples == points + imu + kernel_drops(session)
    assert session.counted("livox", "points.lost") == lost_packets
    assert session.counted("livox", "imu.lost") == lost_samples
    assert session.counted("gopro", "video.lost") == lost_frames > 0
    assert session.doubled == session.partial == []
    assert (np.diff(session.frames) > 0).all()


def test_duplicates_and_reordering_double_nothing_and_lose_nothing(tmp_path, figures):
    with Chain(tmp_path, drivers=NOT_ON_CARD) as chain:
        session = recorded(chain, "duplicated", "duplicate=0.05", "reorder=0.05")
        truth = chain.truth("livox")
        kept_up(chain)
        verdict, reasons = chain.until_verdict()
    dropped = kernel_drops(session)
    lost_packets, lost_samples = missing(np.array(list(session.packets))), missing(session.samples)
    doubles = truth["points"]["duplicated"] + truth["imu"]["duplicated"]
    figures(
        f"{lost_packets + lost_samples} packets, {missing(session.frames)} frames; {doubles} doubled packets "
        f"({session.counted('livox', 'duplicate packets')} counted), {session.counted('livox', 'late packets')} late "
        f"ones put in their place; camera: {session.counted('gopro', 'duplicates')} doubled, "
        f"{session.counted('gopro', 'reordered')} late; {verdict}",
        [*chain.told, *reasons],
    )
    assert session.doubled == session.partial == []
    assert len(np.unique(session.samples)) == len(session.samples)
    assert lost_packets + lost_samples == dropped
    assert (np.diff(session.frames) == 1).all()
    if not dropped:
        assert session.counted("livox", "duplicate packets") == doubles
    assert session.counted("livox", "late packets") > 0
