"""Labels of Label Studio find their images, whatever it did to names and files, and nothing is overwritten unasked."""

from __future__ import annotations

import json
import zipfile

import pytest

from edge.cli import exit_codes
from edge.cli.main import main
from edge.dataset.exports import open_export
from edge.dataset.folder import DatasetFolder
from edge.dataset.labelling import Choices, take_labels
from edge.errors import EdgeError, FormatError
from pipeline.dataset.labels import Box, format_labels
from tests.edge.dataset import scenes
from tests.edge.dataset.scenes import BOX, OTHER

LINE = format_labels([BOX])


def yolo(folder, labels: dict[str, str], classes="ailanthus\n", images: dict[str, bytes] | None = None):
    """labels: path below labels/ without ending -> text."""
    (folder / "labels").mkdir(parents=True)
    (folder / "images").mkdir()
    (folder / "classes.txt").write_text(classes)
    (folder / "notes.json").write_text("{}")
    for name, text in labels.items():
        (folder / "labels" / f"{name}.txt").parent.mkdir(exist_ok=True)
        (folder / "labels" / f"{name}.txt").write_text(text)
    for name, data in (images or {}).items():
        (folder / "images" / name).write_bytes(data)
    return folder


def take(path, made, images=None, **choices):
    return take_labels(open_export(path, images), made, Choices(**choices))


def found(made, stem) -> list[Box]:
    return list(made.labels(next(r for r in made.records if r.stem == stem)).boxes)


@pytest.fixture
def made(tmp_path):
    return scenes.dataset(tmp_path / "trees")


@pytest.mark.parametrize("packed", [False, True])
def test_a_folder_and_a_zip_with_a_folder_in_it_are_read_alike(made, tmp_path, packed):
    export = yolo(tmp_path / "project-1" / "inner", {"p0": LINE, "p1": "", "p9": LINE})
    path = tmp_path / "project-1"
    if packed:
        path = tmp_path / "project.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for file in export.rglob("*"):
                archive.write(file, file.relative_to(tmp_path))
    report = take(path, made)
    assert (report.labelled, report.boxes, report.negatives) == (2, 1, 1)
    assert report.unmatched == ("p9",)
    assert report.unlabelled == 2
    assert found(made, "p0") == [BOX]
    assert found(made, "p1") == []


@pytest.mark.parametrize("told", ["p0", "ab12cd34-p0", "ab12cd__p0", "?d=p0", "p0.png"])
def test_what_label_studio_puts_around_a_name_does_not_hide_the_image(made, tmp_path, told):
    assert take(yolo(tmp_path / "e", {told: LINE}), made).unmatched == ()
    assert found(made, "p0") == [BOX]


def test_a_name_that_was_cut_finds_its_image_unless_several_fit(tmp_path):
    made = DatasetFolder.make(tmp_path / "trees")
    long = ["a" * 240 + "ü" * 5 + str(k) for k in range(2)] + ["b" * 251]
    base = scenes.dataset(tmp_path / "base", 1).records[0]
    made.records = [type(base)(image=f"{stem}.png", sha256=stem, width_px=9, height_px=9) for stem in long]
    report = take(yolo(tmp_path / "e", {"b" * 251: LINE}), made)
    assert report.unmatched == ()
    cut = open_export(yolo(tmp_path / "f", {"a" * 240 + "ü" * 5: LINE}))
    assert take_labels(cut, made, Choices()).unmatched == ("a" * 240 + "ü" * 5,)
    made.records = made.records[1:]
    assert take_labels(cut, made, Choices()).unmatched == ()


def test_images_that_come_along_are_known_by_their_bytes_or_added(made, tmp_path):
    images = {f"{name}.png": scenes.png(k) for name, k in {"renamed": 1, "new": 9, "p0": 8, "bare": 7}.items()}
    export = yolo(tmp_path / "e", {"renamed": LINE, "new": LINE, "p2": ""}, images=images)
    report = take(export, made, site="moor", source="field")
    assert found(made, "p1") == [BOX]
    new = next(record for record in made.records if record.image == "new.png")
    assert (new.site, new.source, new.width_px) == ("moor", "field", scenes.SIZE[0])
    assert made.image_path(new).read_bytes() == scenes.png(9)
    assert report.added_images == 1
    assert report.without_labels == ("bare", "p0")
    again = DatasetFolder.open(made.folder)
    assert again.records == made.records


def test_another_picture_with_a_name_that_is_taken_is_not_mistaken(made, tmp_path):
    folder = tmp_path / "photos"
    folder.mkdir()
    (folder / "x.png").write_bytes(scenes.png(20))
    report = take(yolo(tmp_path / "e", {"x": LINE}), made, images=folder)
    assert report.added_images == 1
    assert take(yolo(tmp_path / "f", {"x": LINE}), made).unchanged == 1


def test_classes_go_by_name_and_new_ones_join_when_a_box_has_them(made, tmp_path):
    sumac_first = "sumac\nAilanthus\nunused\n"
    text = format_labels([Box(1, 0.5, 0.5, 0.2, 0.2), Box(0, 0.5, 0.5, 0.1, 0.1)])
    report = take(yolo(tmp_path / "e", {"p0": text}, sumac_first), made)
    assert made.classes == ["ailanthus", "sumac"]
    assert report.new_classes == ("sumac",)
    assert [box.class_id for box in found(made, "p0")] == [0, 1]
    bare = scenes.dataset(tmp_path / "bare", classes=())
    take(yolo(tmp_path / "f", {"p0": text}, sumac_first), bare)
    assert bare.classes == ["sumac", "Ailanthus", "unused"]


def test_lines_that_are_no_boxes_stop_everything_unless_their_images_may_stay_unlabelled(made, tmp_path):
    export = yolo(tmp_path / "e", {"p0": LINE + "0 700 2 3 4\n", "p1": LINE})
    with pytest.raises(FormatError, match=r"labels/p0.txt:2: 700 is far outside"):
        take(export, made)
    assert made.labels(made.records[1]) is None
    report = take(export, made, skip_broken=True)
    assert len(report.broken) == 1
    assert made.labels(made.records[0]) is None
    assert found(made, "p1") == [BOX]


def test_labels_that_are_there_are_replaced_only_when_asked(made, tmp_path):
    take(yolo(tmp_path / "e", {"p0": LINE, "p1": ""}), made)
    export = yolo(tmp_path / "f", {"p0": "", "p1": "", "p2": LINE})
    with pytest.raises(EdgeError, match=r"1 images have other labels already \(p0.png\)"):
        take(export, made)
    assert found(made, "p0") == [BOX]
    assert made.labels(made.records[2]) is None
    report = take(export, made, replace=True)
    assert (report.replaced, report.unchanged) == (1, 1)
    assert found(made, "p0") == []


def test_empty_files_can_mean_that_nobody_looked(made, tmp_path):
    take(yolo(tmp_path / "e", {"p0": LINE, "p1": ""}), made, empty="unlabelled")
    assert made.labels(made.records[1]) is None


def test_people_in_folders_agree_or_one_is_chosen(made, tmp_path):
    labels = {"1/p0": LINE, "2/p0": format_labels([OTHER]), "1/p1": LINE, "2/p1": LINE, "2/p2": LINE}
    export = yolo(tmp_path / "e", labels)
    with pytest.raises(FormatError, match=r"p0.png: labelled differently by 1, 2; choose with --labeler"):
        take(export, made)
    take(export, made, labeler="2")
    assert found(made, "p0") == [OTHER]
    assert found(made, "p1") == found(made, "p2") == [BOX]


def test_json_tells_negatives_from_images_nobody_opened_and_ground_truth_decides(made, tmp_path):
    def annotation(box: Box, by: int, **fields):
        x, y, _, _ = box.corners
        value = {"x": 100 * x, "y": 100 * y, "width": 100 * box.w, "height": 100 * box.h}
        mark = {"type": "rectanglelabels", "value": value | {"rectanglelabels": ["ailanthus"]}}
        return {"completed_by": by, "result": [mark], **fields}

    def task(name, *annotations):
        return {"data": {"image": f"/data/local-files/?d=trees/images/{name}"}, "annotations": list(annotations)}

    tasks = [
        task("p0.png", annotation(BOX, 1), annotation(OTHER, 2, ground_truth=True)),
        task("p1.png", {"completed_by": 1, "result": []}),
        task("p2.png"),
    ]
    (tmp_path / "export.json").write_text(json.dumps(tasks))
    report = take(tmp_path / "export.json", made)
    assert (report.labelled, report.negatives) == (2, 1)
    assert found(made, "p0")[0].corners == pytest.approx(OTHER.corners)
    assert made.labels(made.records[2]) is None


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ({"a.txt": b"x"}, "neither a YOLO export"),
        ({"classes.txt": b"a\n\nb\n"}, "classes.txt:2: an empty row"),
        ({"classes.txt": b"a\nb\na\n"}, "classes.txt:3: 'a' stands there twice"),
        ({"classes.txt": b" \n"}, "names no class"),
        ({"classes.txt": b"a\n", "labels/p0.txt": b"\xff\xfe"}, "labels/p0.txt: byte 0 is not UTF-8"),
        ({"a.json": b"{}"}, "a list of tasks"),
    ],
)
def test_what_is_no_export_is_refused(made, tmp_path, content, why):
    for name, data in content.items():
        (tmp_path / "e" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "e" / name).write_bytes(data)
    with pytest.raises(FormatError, match=why):
        take(tmp_path / "e", made)
    with pytest.raises(FormatError, match="no such file"):
        take(tmp_path / "missing.zip", made)


def test_the_command_takes_a_foreign_folder_as_a_new_dataset(tmp_path, capsys):
    images = {"a.png": scenes.png(0), "b.png": scenes.png(1)}
    export = yolo(tmp_path / "e", {"a": LINE, "b": "", "c": LINE}, images=images)
    assert main(["dataset", "labels", str(export), str(tmp_path / "new"), "--site", "moor"]) == exit_codes.WARNINGS
    told = capsys.readouterr().out
    assert "2 images with 1 boxes, 1 of them with nothing there" in told
    assert "JSON can" in told
    assert "labels of images that are not here (--images): 1 (c)" in told
    made = DatasetFolder.open(tmp_path / "new")
    assert made.classes == ["ailanthus"]
    assert {record.site for record in made.records} == {"moor"}
