"""The program that trains: ultralytics in an environment of its own, never loaded into this one."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from edge.errors import EdgeError, UsageError

AGPL = (
    "Training is done by ultralytics, a program of its own under the AGPL-3.0. Its makers hold that models trained "
    "with it come under the AGPL-3.0 too, or need their enterprise licence. mapforest neither contains nor loads it."
)
GET = (
    "make an environment for it:\n"
    "  python3 -m venv ~/yolo && ~/yolo/bin/pip install ultralytics onnx onnxslim onnxruntime\n"
    "then: mapforest dataset train DATASET --trainer ~/yolo --accept-agpl"
)
_DESCRIBE = """
import importlib.metadata as m, json, platform, sys
found = {"versions": {"python": platform.python_version()}}
for name in ("ultralytics", "torch", "torchvision", "onnx"):
    try:
        found["versions"][name] = m.version(name)
    except m.PackageNotFoundError:
        pass
if sys.argv[1:]:
    import onnx
    model = onnx.load(sys.argv[1])
    shape = lambda value: [d.dim_value or d.dim_param for d in value.type.tensor_type.shape.dim]
    found["input"], found["output"] = shape(model.graph.input[0]), shape(model.graph.output[0])
    found["opset"] = next(one.version for one in model.opset_import if one.domain in ("", "ai.onnx"))
    found["metadata"] = {one.key: one.value for one in model.metadata_props}
print(json.dumps(found))
"""


class Described(msgspec.Struct):
    """What the trainer's environment says of itself, and of a model. opset 0: not asked."""

    versions: dict[str, str] = {}
    input: list[Any] = []
    output: list[Any] = []
    opset: int = 0
    metadata: dict[str, str] = {}


@dataclass(frozen=True, slots=True)
class Trainer:
    """program: `yolo`. python: of its environment."""

    program: Path
    python: Path

    def run(self, arguments: Sequence[str], folder: Path, log: Path) -> None:
        """To the end, its words on standard error and in the log. EdgeError when it fails."""
        with log.open("a", encoding="utf-8") as kept:
            kept.write(f"$ {self.program} {' '.join(arguments)}\n")
            kept.flush()
            process = subprocess.Popen(
                [str(self.program), *arguments],
                cwd=folder,
                env=_environment(folder),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                encoding="utf-8",
                errors="replace",
            )
            try:
                assert process.stdout is not None
                for line in process.stdout:
                    sys.stderr.write(line)
                    kept.write(line)
                code = process.wait()
            finally:
                if process.poll() is None:
                    process.terminate()
                    process.wait()
                if process.stdout is not None:
                    process.stdout.close()
        if code != 0:
            raise EdgeError(f"{self.program} ended with {code}; what it said is in {log}")

    def describe(self, folder: Path, model: Path | None = None) -> Described:
        """Asked of its Python. EdgeError."""
        command = [str(self.python), "-c", _DESCRIBE, *([str(model)] if model is not None else [])]
        done = subprocess.run(command, capture_output=True, text=True, env=_environment(folder), check=False)
        try:
            return msgspec.json.decode(done.stdout.strip().rpartition("\n")[2], type=Described)
        except msgspec.MsgspecError as error:
            said = done.stderr.strip().rpartition("\n")[2] or "nothing"
            raise EdgeError(f"{self.python} cannot tell what is in {model or 'its environment'}: {said}") from error


def find_trainer(given: Path | None) -> Trainer:
    """given: an environment's folder, its Python, or its `yolo`; None: from the PATH. UsageError says how to get it."""
    if given is None:
        found = shutil.which("yolo")
        if found is None:
            raise UsageError(f"no `yolo` on the PATH: training needs ultralytics; {GET}")
        return _trainer(Path(found))
    given = given.expanduser()
    if given.is_dir():
        return _trainer(given / "bin" / "yolo")
    return _trainer(given.with_name("yolo") if given.name.startswith("python") else given)


def _trainer(program: Path) -> Trainer:
    if not os.access(program, os.X_OK) or program.is_dir():
        raise UsageError(f"{program}: there is no such program, so ultralytics is not installed there; {GET}")
    python = program.with_name("python")
    if not python.exists():
        raise UsageError(f"{program}: there is no python beside it; name the environment that ultralytics is in")
    return Trainer(program.absolute(), python.absolute())


def _environment(folder: Path) -> dict[str, str]:
    """It installs nothing by itself, keeps its settings in the run's folder, and finds none of this program."""
    mine = {"YOLO_AUTOINSTALL": "false", "YOLO_CONFIG_DIR": str(folder / "settings"), "PYTHONUNBUFFERED": "1"}
    left_out = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    return {name: value for name, value in os.environ.items() if name not in left_out} | mine
