import json

import av
import cv2
import numpy as np
import pytest

from edge.calibration.file import write
from edge.cli.main import main
from edge.recording.calibration import CalibrationFile, Pose, load_calibration
from tests.pipeline.calibration.boards import CHESS, PINHOLE, photograph, poses

BOARD = ["--corners", "8x5", "--square", "0.04"]


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("board")
    number = 0
    for turn, move in poses(80, tilt_deg=30.0):
        if number < 12 and PINHOLE.project(turn.apply(CHESS.corners_m) + move)[1].all():
            cv2.imwrite(str(folder / f"{number}.png"), photograph(CHESS, PINHOLE, turn, move))
            number += 1
    return folder


def test_a_folder_of_pictures_becomes_the_lens_in_the_file_and_the_rest_of_it_stays(photos, tmp_path, capsys):
    file = tmp_path / "calibration.toml"
    write(file, CalibrationFile(camera=Pose((0.1, 0.2, 0.3))))
    arguments = ["calibrate", "lens", str(photos), *BOARD, "--file", str(file), "--lens", "linear", "--json"]
    assert main([*arguments, "--camera-serial", "C1", "--picture", str(tmp_path / "map.png")]) == 3
    report = json.loads(capsys.readouterr().out)
    found = load_calibration(str(file)).file
    assert found.intrinsics.focal_px == pytest.approx(PINHOLE.focal_px, rel=0.01)
    assert found.intrinsics.residual_px == pytest.approx(report["intrinsics"]["residual_px"])
    assert (found.about.camera_lens, found.about.camera_serial) == ("linear", "C1")
    assert found.camera.translation_m == (0.1, 0.2, 0.3)
    assert report["concerns"][0].startswith("only 12 pictures")
    assert cv2.imread(str(tmp_path / "map.png")).shape == (480, 848, 3)


def test_a_video_is_looked_at_picture_by_picture(photos, tmp_path, capsys):
    path = tmp_path / "board.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=5)
        stream.width, stream.height, stream.pix_fmt = 848, 480, "yuv420p"
        for photo in sorted(photos.glob("*.png")):
            for _ in range(3):  # held still for a moment
                frame = av.VideoFrame.from_ndarray(cv2.imread(str(photo)), format="bgr24")
                container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    file = tmp_path / "calibration.toml"
    assert main(["calibrate", "lens", str(path), *BOARD, "--file", str(file)]) == 3
    out = capsys.readouterr().out
    assert "pictures of 36 looked at (" in out
    assert load_calibration(str(file)).file.intrinsics.focal_px == pytest.approx(PINHOLE.focal_px, rel=0.02)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "no such file or folder"),
        (["{photos}/0.png"], "found in 1 pictures"),
        (["{tmp}/text.mp4"], "not a video"),
        (["{tmp}/text.png"], "not a picture"),
        (["{photos}", "{tmp}/small.png"], "320x200 pixels, the first picture had 848x480"),
    ],
)
def test_what_cannot_be_used_is_told(photos, tmp_path, capsys, arguments, said):
    for name in ("text.mp4", "text.png"):
        (tmp_path / name).write_text("no picture")
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((200, 320), np.uint8))
    given = [argument.format(photos=photos, tmp=tmp_path) for argument in arguments]
    assert main(["calibrate", "lens", *given, *BOARD, "--file", str(tmp_path / "c.toml")]) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "c.toml").exists()


def test_a_size_that_is_none_is_wrong_usage(photos, capsys):
    assert main(["calibrate", "lens", str(photos), "--corners", "many", "--square", "0.04"]) == 2
    assert "9x6" in capsys.readouterr().err


def test_the_board_to_print_comes_with_its_size(tmp_path, capsys):
    path = tmp_path / "board.png"
    assert main(["calibrate", "print", str(path), *BOARD, "--marker", "0.03", "--dpi", "100"]) == 0
    assert "print it 4" in capsys.readouterr().out
    assert cv2.imread(str(path)).shape[:2] == (8 * 157, 11 * 157)
