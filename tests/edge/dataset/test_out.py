"""Tasks, parts and splits of a dataset, and what a check finds, by the commands a person gives."""

from __future__ import annotations

import json
from urllib.parse import parse_qs, urlparse

import msgspec
import pytest

from edge.cli import exit_codes
from edge.cli.main import main
from edge.dataset.exports import open_export
from edge.dataset.folder import DatasetFolder
from edge.dataset.labelling import Choices, take_labels
from pipeline.dataset.labels import Box, format_labels
from tests.edge.dataset import scenes
from tests.edge.dataset.scenes import BOX, OTHER


def run(capsys, *words) -> tuple[int, str]:
    code = main(["dataset", *map(str, words)])
    told = capsys.readouterr()
    return code, told.out + told.err


def spread(folder, count: int = 40, metres: float = 10.0, **fields) -> DatasetFolder:
    """Labelled pictures on a line, so far apart."""
    made = scenes.dataset(folder, count, source="field", site="wood", session="walk", **fields)
    made.records = [
        msgspec.structs.replace(r, latitude_deg=47.0 + k * metres / 111_320, longitude_deg=8.0, stamp_ns=k * 10**10)
        for k, r in enumerate(made.records)
    ]
    made.save()
    scenes.label(made, **{record.stem: [BOX, OTHER][: k % 3] for k, record in enumerate(made.records)})
    return made


def test_tasks_name_the_images_that_have_no_labels_and_carry_suggestions(tmp_path, capsys):
    made = scenes.dataset(tmp_path / "trees", 3)
    scenes.label(made, p0=[BOX])
    (tmp_path / "said").mkdir()
    boxes = [Box(0, 0.5, 0.5, 0.2, 0.4, 0.875), Box(0, 0.3, 0.3, 0.1, 0.1, 0.1)]
    (tmp_path / "said" / "p1.txt").write_text(format_labels(boxes, predictions=True))
    words = ("--predictions", tmp_path / "said", "--model", "v1")
    code, told = run(capsys, "tasks", tmp_path / "trees", "--output", tmp_path / "tasks.json", *words)
    assert code == exit_codes.GOOD
    assert "tasks: 2; boxes suggested: 1, in 1 of them" in told
    assert "images without a prediction: 1" in told
    first, second = json.loads((tmp_path / "tasks.json").read_text())
    path = parse_qs(urlparse(first["data"]["image"]).query)["d"][0]
    assert (tmp_path / path).read_bytes() == scenes.png(1)
    (prediction,) = first["predictions"]
    assert prediction["model_version"] == "v1"
    assert [one["score"] for one in prediction["result"]] == [0.875]
    assert "predictions" not in second
    assert 'value="ailanthus"' in (tmp_path / "label_config.xml").read_text()


def test_suggestions_that_are_accepted_come_back_as_labels(tmp_path):
    made = scenes.dataset(tmp_path / "trees", 1, classes=())
    (tmp_path / "said").mkdir()
    (tmp_path / "said" / "p0.txt").write_text(format_labels([BOX]))
    words = ["--predictions", str(tmp_path / "said"), "--class", "ailanthus"]
    main(["dataset", "tasks", str(tmp_path / "trees"), "--output", str(tmp_path / "t.json"), *words])
    (task,) = json.loads((tmp_path / "t.json").read_text())
    task["annotations"] = [{"completed_by": 1, "result": task["predictions"][0]["result"]}]
    (tmp_path / "export.json").write_text(json.dumps([task]))
    take_labels(open_export(tmp_path / "export.json"), made, Choices())
    assert made.classes == ["ailanthus"]
    assert made.labels(made.records[0]).boxes[0].corners == pytest.approx(BOX.corners)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--predictions", "missing"], "no such folder"),
        (["--predictions", "."], "p0.txt:1: "),
        (["--class", "sumac"], "has its classes already"),
    ],
)
def test_tasks_that_cannot_be_made_are_refused(tmp_path, capsys, words, why):
    scenes.dataset(tmp_path / "trees", 1)
    (tmp_path / "p0.txt").write_text("0 0.5 0.5\n")
    words = [word if word.startswith("-") or word == "sumac" else tmp_path / word for word in words]
    code, told = run(capsys, "tasks", tmp_path / "trees", "--output", tmp_path / "t.json", *words)
    assert code in (exit_codes.FAILED, exit_codes.USAGE)
    assert why in told


def test_a_split_goes_out_as_a_dataset_of_its_own(tmp_path, capsys):
    made = spread(tmp_path / "trees")
    assert run(capsys, "split", tmp_path / "trees")[0] == exit_codes.GOOD
    made = DatasetFolder.open(tmp_path / "trees")
    code, _ = run(capsys, "export", tmp_path / "trees", "--output", tmp_path / "test", "--split", "test")
    assert code == exit_codes.GOOD
    test = DatasetFolder.open(tmp_path / "test")
    assert test.records == [record for record in made.records if record.split == "test"]
    assert test.classes == made.classes
    for record in test.records:
        assert test.image_path(record).read_bytes() == made.image_path(record).read_bytes()
        assert test.labels(record) == made.labels(record)
    assert (tmp_path / "test" / "test.txt").read_text().split() == [f"./images/{r.image}" for r in test.records]
    again, told = run(capsys, "export", tmp_path / "trees", "--output", tmp_path / "test")
    assert (again, "not empty" in told) == (exit_codes.USAGE, True)
    nowhere = run(capsys, "export", tmp_path / "trees", "--output", tmp_path / "x", "--site", "moor")
    assert nowhere[0] == exit_codes.USAGE


def test_split_says_what_it_did_and_what_leaks_when_forced(tmp_path, capsys):
    spread(tmp_path / "trees")
    code, told = run(capsys, "split", tmp_path / "trees", "--json", "--shares", "60,20,20")
    found = json.loads(told)
    assert code == exit_codes.GOOD
    assert found["leaks"] == {}
    assert sum(found["images"].values()) == 40
    assert found["images"]["gap"] == found["set_aside"] > 0
    code, told = run(capsys, "--json", "split", tmp_path / "trees", "--by", "image", "--force")
    assert code == exit_codes.WARNINGS
    assert json.loads(told)["leaks"]["nearer than the gap"] > 0
    code, told = run(capsys, "check", tmp_path / "trees")
    assert code == exit_codes.WARNINGS
    assert "in different splits but nearer than the gap" in told


@pytest.mark.parametrize("shares", ["80,10", "80,10,x", "80,10,20", "110,-10,0"])
def test_shares_that_do_not_make_a_whole_are_refused(tmp_path, capsys, shares):
    scenes.dataset(tmp_path / "trees", 3)
    code, told = run(capsys, "split", tmp_path / "trees", "--shares", shares)
    assert code == exit_codes.USAGE
    assert "--shares" in told


def test_too_small_a_dataset_is_refused_with_what_to_do(tmp_path, capsys):
    spread(tmp_path / "trees", 4)
    code, told = run(capsys, "split", tmp_path / "trees")
    assert code == exit_codes.USAGE
    assert "--block" in told


def test_a_split_for_which_nothing_is_left_is_said(tmp_path, capsys):
    spread(tmp_path / "trees", 12, metres=20.0)
    code, told = run(capsys, "split", tmp_path / "trees", "--gap", "500")
    assert code == exit_codes.WARNINGS
    assert "nothing is left for" in told


def test_statistics_are_shown(tmp_path, capsys):
    spread(tmp_path / "trees")
    code, told = run(capsys, "statistics", tmp_path / "trees")
    assert code == exit_codes.GOOD
    assert ["site", "wood", "40", "40", "14", "39"] in [line.split() for line in told.splitlines()]
    assert "licences: own 40" in told
    assert json.loads(run(capsys, "statistics", tmp_path / "trees", "--json")[1])["total"]["boxes"] == 39


def test_a_sound_dataset_passes(tmp_path, capsys):
    spread(tmp_path / "trees")
    run(capsys, "split", tmp_path / "trees")
    code, told = run(capsys, "check", tmp_path / "trees")
    assert code == exit_codes.GOOD, told
    assert "good" in told


def _no_image(made):
    made.image_path(made.records[0]).unlink()


def _stray_image(made):
    (made.folder / "images" / "stray.png").write_bytes(scenes.png(99))


def _stray_label(made):
    (made.folder / "labels" / "stray.txt").write_text("")


def _broken_image(made):
    made.image_path(made.records[0]).write_bytes(b"\x89PNG\r\n")


def _other_size(made):
    made.image_path(made.records[0]).write_bytes(scenes.png(0, (40, 30)))


def _edited_image(made):
    made.image_path(made.records[0]).write_bytes(scenes.png(77))


def _twice(made):
    made.add(msgspec.structs.replace(made.records[0], image="again.png"), scenes.png(0))


def _shared_stem(made):
    made.add(msgspec.structs.replace(made.records[0], image="p0.jpg"), scenes.png(98))


def _broken_label(made):
    made.label_path(made.records[0]).write_text("0 0.5 0.5\n")


def _no_classes(made):
    (made.folder / "classes.txt").unlink()
    made.label_path(made.records[1]).write_text("0 0.5 0.5 0.1 0.1\n")


def _unused_class(made):
    made.classes.append("sumac")
    made.save()


def _no_licence(made):
    made.records[0] = msgspec.structs.replace(made.records[0], source="inaturalist")
    made.save()


@pytest.mark.parametrize(
    ("harm", "code", "word"),
    [
        (_no_image, exit_codes.FAILED, "not in images/"),
        (_stray_image, exit_codes.WARNINGS, "not in the manifest: stray.png"),
        (_stray_label, exit_codes.WARNINGS, "labels have no image: stray"),
        (_broken_image, exit_codes.FAILED, "cannot be read: p0.png"),
        (_other_size, exit_codes.FAILED, "another size"),
        (_edited_image, exit_codes.WARNINGS, "changed since"),
        (_twice, exit_codes.WARNINGS, "byte for byte"),
        (_shared_stem, exit_codes.FAILED, "share one label file: p0"),
        (_broken_label, exit_codes.FAILED, "labels/p0.txt:1: 3 values"),
        (_no_classes, exit_codes.FAILED, "no classes.txt"),
        (_unused_class, exit_codes.WARNINGS, "classes have no box: sumac"),
        (_no_licence, exit_codes.FAILED, "no licence"),
    ],
)
def test_a_check_finds_what_is_wrong(tmp_path, capsys, harm, code, word):
    harm(spread(tmp_path / "trees", 6))
    found, told = run(capsys, "check", tmp_path / "trees")
    assert word in told
    assert found == code
