"""Training: what the trainer is given, and what is made of what it leaves. A stand-in takes the trainer's place."""

from __future__ import annotations

import json
import os
import stat
import sys
from pathlib import Path

import msgspec
import pytest
from ruamel.yaml import YAML

from edge.cli import exit_codes
from edge.cli.main import main
from edge.dataset.card import data_facts, read_metrics
from edge.dataset.folder import DatasetFolder
from edge.dataset.recipe import yaml_text
from edge.dataset.trainer import find_trainer
from edge.errors import EdgeError, FormatError, UsageError
from tests.edge.dataset import scenes
from tests.edge.dataset.scenes import BOX

PROGRAM = """#!{python}
# Keeps what it was told, and leaves the files the real one leaves.
import json, os, sys
from pathlib import Path
here, told = Path(__file__).parent, sys.argv[1:]
config = dict(json.loads('{{"' + line.replace(": ", '": ', 1) + "}}") .popitem() for line in
              Path(told[0][4:]).read_text().splitlines()) if told[0].startswith("cfg=") else {{}}
names = ("YOLO_AUTOINSTALL", "YOLO_CONFIG_DIR", "PYTHONPATH")
with (here / "told.jsonl").open("a") as file:
    file.write(json.dumps([told, config, os.getcwd(), {{n: os.environ.get(n) for n in names}}]) + "\\n")
weights = Path("train/weights")
print("working on", told[0])
if (here / "fail").exists() and told[0] != "settings":
    sys.exit(3)
if told[0].startswith("cfg=") or told[0] == "train":
    weights.mkdir(parents=True, exist_ok=True)
    (weights / "best.pt").write_text("best")
    (weights / "last.pt").write_text("last")
    rows = ["epoch,  time, metrics/precision(B),metrics/recall(B),metrics/mAP50(B),metrics/mAP50-95(B)"]
    rows += ["1,9,0.5,0.4,0.3,0.2", "2,9,0.6,0.5,0.4,0.3", "3,9,0.9,0.1,0.2,0.1"]
    Path("train/results.csv").write_text("\\n".join(rows))
elif told[0] == "export" and not (here / "no_onnx").exists():
    (weights / "best.onnx").write_bytes(b"a network")
"""
PYTHON = """#!{python}
import sys
from pathlib import Path
print("a warning of some library")
print((Path(__file__).parent / "described.json").read_text())
"""
DESCRIBED = {
    "versions": {"ultralytics": "8.4.0", "torch": "2.0"},
    "input": [1, 3, 832, 832],
    "output": [1, 5, 14196],
    "opset": 17,
    "metadata": {"names": "{0: 'ailanthus'}"},
}


def program(path: Path, text: str) -> None:
    path.write_text(text.format(python=sys.executable))
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


@pytest.fixture
def trainer(tmp_path):
    """The folder of an environment with the stand-in."""
    binaries = tmp_path / "environment" / "bin"
    binaries.mkdir(parents=True)
    program(binaries / "yolo", PROGRAM)
    program(binaries / "python", PYTHON)
    (binaries / "described.json").write_text(json.dumps(DESCRIBED).replace("\n", ""))
    return tmp_path / "environment"


def told(trainer) -> list:
    return [json.loads(line) for line in (trainer / "bin" / "told.jsonl").read_text().splitlines()]


@pytest.fixture
def trees(tmp_path):
    """Six images: four for training, of which one has nothing and one no labels, one each for validation and test."""
    made = scenes.dataset(tmp_path / "trees", 6, site="wood")
    splits = ("train", "train", "train", "train", "val", "test")
    made.records = [msgspec.structs.replace(r, split=s) for r, s in zip(made.records, splits, strict=True)]
    photo = {"source": "inaturalist", "licence": "cc-by-nc", "non_commercial": True, "attribution": "(c) Ann"}
    made.records[0] = msgspec.structs.replace(made.records[0], **photo)
    made.save()
    scenes.label(made, p0=[BOX], p1=[], p2=[BOX, BOX], p4=[BOX], p5=[BOX])
    return made


def train(made, trainer, run, *words) -> int:
    options = ["--trainer", str(trainer), "--output", str(run), "--accept-agpl", *words]
    return main(["dataset", "train", str(made.folder), *options])


def test_the_trainer_gets_the_published_recipe_and_only_images_somebody_looked_at(trees, trainer, tmp_path):
    run = tmp_path / "run"
    assert train(trees, trainer, run) == exit_codes.GOOD
    (settings, _, _, _), (arguments, config, folder, environment), (export, _, _, _) = told(trainer)
    assert settings == ["settings", "sync=False"]
    assert arguments == [f"cfg={run / 'recipe.yaml'}"]
    assert config == {
        "task": "detect", "mode": "train", "data": str(run / "data.yaml"), "project": str(run), "name": "train",
        "exist_ok": True, "model": "yolov8s.pt", "imgsz": 832, "epochs": 200, "lr0": 0.001, "optimizer": "AdamW",
        "batch": 16, "seed": 0,
    }  # fmt: skip
    assert folder == str(run)
    assert environment == {"YOLO_AUTOINSTALL": "false", "YOLO_CONFIG_DIR": str(run / "settings"), "PYTHONPATH": None}
    weights = run / "train" / "weights"
    expected = ["export", f"model={weights / 'best.pt'}", "format=onnx", "imgsz=832", "opset=17"]
    assert export == [*expected, "dynamic=False", "batch=1"]
    lists = {name: (run / f"{name}.txt").read_text().split() for name in ("train", "val", "test")}
    assert lists["train"] == [str(trees.folder / "images" / f"p{k}.png") for k in (0, 1, 2)]
    assert all(Path(path).exists() for paths in lists.values() for path in paths)
    assert (run / "data.yaml").read_text() == (
        'train: train.txt\nval: val.txt\ntest: test.txt\nnames:\n  0: "ailanthus"\n'
    )


def test_the_card_tells_data_recipe_versions_and_metrics(trees, trainer, tmp_path, capsys):
    run = tmp_path / "run"
    train(trees, trainer, run, "--json")
    card = json.loads((run / "card.json").read_text())
    assert json.loads(capsys.readouterr().out) == card
    assert (run / "model.onnx").read_bytes() == b"a network"
    assert card["classes"] == ["ailanthus"]
    assert card["metrics"] == {"epoch": 2.0, "precision": 0.6, "recall": 0.5, "map50": 0.4, "map50_95": 0.3}
    assert card["data"]["images"] == {"train": 3, "val": 1, "test": 1}
    assert card["data"]["boxes"] == {"train": 2, "val": 1, "test": 1}  # a box that is there twice counts once
    assert card["data"]["licences"] == {"cc-by-nc": 1, "own": 4}
    assert card["data"]["non_commercial"] == 1
    assert card["versions"]["ultralytics"] == "8.4.0"
    assert card["recipe"]["lr0"] == 0.001
    assert "AGPL" in card["terms"]
    assert "1 x 3 x 832 x 832" in (run / "card.md").read_text()
    assert (run / "attribution.csv").read_text().splitlines()[1:] == ["p0.png,cc-by-nc,(c) Ann,"]
    log = (run / "train.log").read_text()
    assert "working on cfg=" in log
    assert "working on export" in log


def test_the_hash_of_the_data_changes_with_a_label_an_image_or_a_split_only(trees):
    first = data_facts(trees).sha256
    assert data_facts(DatasetFolder.open(trees.folder)).sha256 == first
    trees.set_labels(trees.records[0], [])
    second = data_facts(trees).sha256
    trees.records[1] = msgspec.structs.replace(trees.records[1], split="val")
    third = data_facts(trees).sha256
    trees.records[2] = msgspec.structs.replace(trees.records[2], sha256="0")
    fourth = data_facts(trees).sha256
    assert len({first, second, third, fourth}) == 4
    trees.records[3] = msgspec.structs.replace(trees.records[3], sha256="0")  # nobody has looked at it
    assert data_facts(trees).sha256 == fourth


def test_options_reach_the_trainer_and_the_last_word_is_the_users(trees, trainer, tmp_path):
    described = DESCRIBED | {"input": [1, 3, 640, 640]}
    (trainer / "bin" / "described.json").write_text(json.dumps(described))
    words = ["--model", "yolov8n.yaml", "--size", "640", "--epochs", "3", "--rate", "0.01", "--device", "0"]
    more = ["--set", "patience=50", "--set", "cos_lr=True", "--set", "optimizer=SGD"]
    assert train(trees, trainer, tmp_path / "run", *words, *more) == exit_codes.GOOD
    config = told(trainer)[1][1]
    assert (config["model"], config["imgsz"], config["epochs"], config["lr0"]) == ("yolov8n.yaml", 640, 3, 0.01)
    assert (config["device"], config["patience"], config["cos_lr"], config["optimizer"]) == ("0", 50, True, "SGD")


def test_the_licence_is_said_first_and_must_be_accepted(trees, trainer, tmp_path, capsys):
    options = ["--trainer", str(trainer), "--output", str(tmp_path / "run")]
    assert main(["dataset", "train", str(trees.folder), *options]) == exit_codes.USAGE
    said = capsys.readouterr().err
    assert "AGPL-3.0" in said
    assert "--accept-agpl" in said
    assert not (trainer / "bin" / "told.jsonl").exists()
    assert not (tmp_path / "run").exists()
    train(trees, trainer, tmp_path / "run")
    said = capsys.readouterr().err
    assert said.index("AGPL-3.0") < said.index("working on")


def test_without_ultralytics_it_is_said_how_to_get_it(trees, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["dataset", "train", str(trees.folder), "--accept-agpl"]) == exit_codes.USAGE
    said = capsys.readouterr().err
    assert "pip install ultralytics onnx" in said
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match="pip install ultralytics"):
        find_trainer(tmp_path / "empty")


def test_an_environment_its_python_and_its_program_mean_the_same(trainer, monkeypatch):
    found = {find_trainer(trainer), find_trainer(trainer / "bin" / "python"), find_trainer(trainer / "bin" / "yolo")}
    monkeypatch.setenv("PATH", f"{trainer / 'bin'}{os.pathsep}{os.environ['PATH']}")
    assert found == {find_trainer(None)}
    (trainer / "bin" / "python").unlink()
    with pytest.raises(UsageError, match="no python beside it"):
        find_trainer(trainer)


def test_a_trainer_that_fails_or_leaves_nothing_is_an_error_that_names_the_log(trees, trainer, tmp_path, capsys):
    (trainer / "bin" / "fail").touch()
    assert train(trees, trainer, tmp_path / "a") == exit_codes.FAILED
    assert f"ended with 3; what it said is in {tmp_path / 'a' / 'train.log'}" in capsys.readouterr().err
    (trainer / "bin" / "fail").rename(trainer / "bin" / "no_onnx")
    assert train(trees, trainer, tmp_path / "b") == exit_codes.FAILED
    assert "left no" in capsys.readouterr().err


def test_an_interrupted_run_goes_on_where_it_was(trees, trainer, tmp_path, capsys):
    run = tmp_path / "run"
    assert train(trees, trainer, run, "--resume") == exit_codes.USAGE
    (trainer / "bin" / "no_onnx").touch()
    train(trees, trainer, run)
    assert train(trees, trainer, run) == exit_codes.USAGE
    assert "--resume" in capsys.readouterr().err
    (trainer / "bin" / "no_onnx").unlink()
    assert train(trees, trainer, run, "--resume") == exit_codes.GOOD
    assert [one[0][0] for one in told(trainer)][-2:] == ["settings", "export"]  # it was through with training
    (run / "trained").unlink()
    assert train(trees, trainer, run, "--resume") == exit_codes.GOOD
    last = run / "train" / "weights" / "last.pt"
    assert told(trainer)[-2][0] == ["train", "resume=True", f"model={last}"]


def test_a_model_that_the_payload_would_refuse_is_an_error(trees, trainer, tmp_path, capsys):
    odd = {"takes": {"input": [1, 3, "height", "width"]}, "names": {"metadata": {"names": "{0: 'tree'}"}}}
    for why, described in odd.items():
        (trainer / "bin" / "described.json").write_text(json.dumps(DESCRIBED | described))
        assert train(trees, trainer, tmp_path / why) == exit_codes.FAILED
        assert f"the exported model {why}" in capsys.readouterr().err


def test_a_dataset_that_is_not_ready_is_refused(trees, trainer, tmp_path, capsys):
    def refused(word: str) -> None:
        assert train(trees, trainer, tmp_path / "run") == exit_codes.USAGE
        assert word in capsys.readouterr().err

    for record in (trees.records[0], trees.records[2]):
        trees.set_labels(record, [])
    refused("no box in train")
    trees.label_path(trees.records[4]).unlink()
    refused("no labelled image is in val")
    (trees.folder / "classes.txt").unlink()
    for path in (trees.folder / "labels").iterdir():
        path.unlink()
    refused("no classes.txt")


@pytest.mark.parametrize("words", [["--size", "830"], ["--epochs", "0"], ["--set", "patience"]])
def test_options_that_make_no_sense_are_refused(trees, trainer, tmp_path, words):
    assert train(trees, trainer, tmp_path / "run", *words) == exit_codes.USAGE


@pytest.mark.parametrize("value", [1e-05, 0.001, 2.5e-07, 1e16, True, 3, "a: b", "ü"])
def test_values_are_yaml(value):
    yaml = YAML(typ="safe", pure=True)
    yaml.version = (1, 1)  # as the trainer reads it
    assert yaml.load(yaml_text({"key": value})) == {"key": value}


def test_a_dry_run_writes_what_would_be_used_and_starts_nothing(trees, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["dataset", "train", str(trees.folder), "--dry-run"]) == exit_codes.GOOD
    recipe = tmp_path / "trees_model" / "recipe.yaml"
    assert capsys.readouterr().out.strip() == f"yolo cfg={recipe}"
    assert "lr0: 0.001" in recipe.read_text()


def test_results_that_are_none_and_an_environment_that_says_nothing_are_errors(tmp_path, trainer):
    (tmp_path / "results.csv").write_text("a,b\n1,2\n")
    with pytest.raises(FormatError, match=r"results.csv: not what the trainer writes"):
        read_metrics(tmp_path / "results.csv")
    (trainer / "bin" / "described.json").write_text("Traceback")
    with pytest.raises(EdgeError, match="cannot tell"):
        find_trainer(trainer).describe(tmp_path)


def test_a_real_python_tells_its_versions(tmp_path, trainer):
    (trainer / "bin" / "python").unlink()
    (trainer / "bin" / "python").symlink_to(sys.executable)
    found = find_trainer(trainer).describe(tmp_path)
    assert found.versions["python"] == ".".join(map(str, sys.version_info[:3]))
    assert found.opset == 0
