import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from drivers.messages import ImuSample, LidarScan
from edge.cli.main import main
from edge.onboard.record import read_onboard
from edge.onboard.telemetry import in_order, read_chapter
from tests.edge.live_recordings import record
from tests.edge.onboard.cards import gyro_payloads, write_mp4
from tests.edge.recording.recording_scene import UTC_NS
from tests.pipeline.calibration.turns import SECOND, Turns

REAL = Path(__file__).parents[3] / "../shared/data/gopro/max-heromode.mp4"
MOUNTED = Rotation.from_euler("zyx", [90.0, 5.0, -85.0], degrees=True)
"""Camera's gyroscope in the body."""
BEGIN_S = 7.25
"""First frame, on the clock of the turns."""
TURNS = Turns(seed=31, seconds=90.0)


def body(at_s: np.ndarray) -> np.ndarray:
    return (TURNS.orientation(at_s - 1e-4).inv() * TURNS.orientation(at_s + 1e-4)).as_rotvec() / 2e-4


def session(root: Path, at_s: np.ndarray, rate: np.ndarray) -> Path:
    octets = np.zeros(5, np.uint8)
    at = [round((t + 100.0) * SECOND) for t in at_s]
    sweep = LidarScan(at[0], at[0], np.ones((5, 3), np.float32), octets, octets, octets, np.arange(5, dtype=np.uint32))
    samples = [ImuSample(t, t, tuple(w), (0.0, 0.0, 9.81)) for t, w in zip(at, rate.tolist(), strict=True)]
    return record(root, [sweep, *samples])


@pytest.fixture
def walk(tmp_path):
    at = np.arange(0.0, 50.0, 0.005)
    return session(tmp_path, at, body(at) + np.random.default_rng(1).normal(0, 0.003, (len(at), 3)))


def chapters(folder: Path, lengths: list[int], *, clock: bool = True, drift: float = 0.0) -> Path:
    """Of 198.3 samples a second, named as the camera does."""
    folder.mkdir()
    start = 0.0
    for number, length in enumerate(lengths):
        at = np.arange(0.0, length, 1.0 / 198.3)
        rate = MOUNTED.inv().apply(body(BEGIN_S + (start + at) * (1.0 + drift)))
        payloads = gyro_payloads(at, rate, clock=clock)
        write_mp4(folder / f"GX{number + 1:02d}0042.MP4", payloads)
        start += len(payloads)
    return folder


@pytest.mark.parametrize("clock", [True, False], ids=["with clock", "by place in the file"])
def test_chapters_are_put_on_the_time_of_the_session_by_their_gyroscope(walk, tmp_path, capsys, clock):
    card = chapters(tmp_path / "card", [20, 15], clock=clock)
    assert main(["import-video", str(walk), str(card), "--json"]) == 0
    (report,) = json.loads(capsys.readouterr().out)
    (video,) = read_onboard(walk).videos
    expected_ns = UTC_NS + round((BEGIN_S + 100.0) * SECOND)
    assert (video.begin_ns - expected_ns) / 1e6 == pytest.approx(0.0, abs=3.0)
    assert [Path(chapter.file).name for chapter in video.chapters] == ["GX010042.MP4", "GX020042.MP4"]
    assert video.chapters[1].start_s == pytest.approx(20.0)
    assert video.session_ns(1, 2.5) == video.begin_ns + round((1.0 + video.drift) * 22.5 * SECOND)
    assert video.sigma_s < 0.015
    assert report["begin_s"] == pytest.approx(BEGIN_S, abs=0.01)
    off = Rotation.from_matrix(video.rotation) * MOUNTED
    assert np.degrees(off.magnitude()) < 0.5


def test_a_video_that_began_before_the_session_is_found_too(tmp_path, capsys):
    at = np.arange(20.0, 60.0, 0.005)
    late = session(tmp_path, at, body(at))
    card = chapters(tmp_path / "card", [40])
    assert main(["import-video", str(late), str(card / "GX010042.MP4")]) == 0
    assert "begins 12.7" in capsys.readouterr().out


def test_a_video_of_another_walk_is_not_taken(walk, tmp_path, capsys):
    at = np.arange(0.0, 40.0, 0.005)
    other = Turns(seed=32, seconds=60.0)
    rate = (other.orientation(at - 1e-4).inv() * other.orientation(at + 1e-4)).as_rotvec() / 2e-4
    path = write_mp4(tmp_path / "GH010001.MP4", gyro_payloads(at, rate))
    assert main(["import-video", str(walk), str(path)]) == 1
    assert "does not belong here" in capsys.readouterr().out
    assert not read_onboard(walk).videos


def test_importing_again_replaces_and_others_stay(walk, tmp_path):
    card = chapters(tmp_path / "card", [20])
    other = tmp_path / "GH010007.MP4"
    other.write_bytes((card / "GX010042.MP4").read_bytes())
    for path in (card, other, card):
        assert main(["import-video", str(walk), str(path)]) == 0
    names = [[Path(chapter.file).name for chapter in video.chapters] for video in read_onboard(walk).videos]
    assert sorted(names) == [["GH010007.MP4"], ["GX010042.MP4"]]


def test_files_are_grouped_as_the_camera_named_them(tmp_path):
    for name in ("GH010001.MP4", "GH020001.MP4", "GX010002.MP4", "GL010001.LRV", "GH030001.MP4", "notes.txt"):
        (tmp_path / name).touch()
    found = [[path.name for path in chapters] for chapters in in_order([tmp_path])]
    assert found == [["GH010001.MP4", "GH020001.MP4", "GH030001.MP4"], ["GX010002.MP4"]]


@pytest.mark.parametrize(
    ("name", "said"), [("gone.mp4", "no such file"), ("text.mp4", "not a video"), ("plain.mp4", "no GoPro telemetry")]
)
def test_files_that_are_not_the_cameras_are_told(walk, tmp_path, capsys, name, said):
    (tmp_path / "text.mp4").write_text("no video")
    at = np.arange(0.0, 5.0, 0.005)
    write_mp4(tmp_path / "plain.mp4", gyro_payloads(at, body(at)), handler=b"Other")
    assert main(["import-video", str(walk), str(tmp_path / name)]) == 1
    assert said in capsys.readouterr().err


@pytest.mark.skipif(not REAL.exists(), reason=f"a real GoPro file is not here: {REAL}")
def test_a_real_file_is_put_where_a_gyroscope_felt_the_same(tmp_path):
    real = read_chapter(REAL)
    assert (real.width_px, real.height_px) == (848, 480)
    assert real.duration_s == pytest.approx(10.5105)
    at = np.arange(-5.0, 20.0, 0.005)
    felt = np.column_stack([np.interp(at, real.times_s, axis, left=0.0, right=0.0) for axis in real.rate.T])
    noise = np.random.default_rng(2).normal(0, 0.004, felt.shape)
    folder = session(tmp_path, at + 3.0, MOUNTED.apply(felt) + noise)
    assert main(["import-video", str(folder), str(REAL)]) == 0
    (video,) = read_onboard(folder).videos
    assert (video.begin_ns - UTC_NS) / SECOND == pytest.approx(103.0, abs=0.004)
    assert video.firmware == "H19.03.01.30.00"
