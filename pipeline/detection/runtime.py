"""onnxruntime: a model file made ready on the best device there is."""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from pipeline.detection.errors import InferenceFailed, ModelUnreadable, RuntimeMissing

Device = Literal["auto", "tensorrt", "cuda", "cpu"]
PROVIDERS: dict[str, str] = {
    "tensorrt": "TensorrtExecutionProvider",
    "cuda": "CUDAExecutionProvider",
    "cpu": "CPUExecutionProvider",
}
"""Device -> its name in onnxruntime, the fastest first."""
_LFS = b"version https://git-lfs"
_QUIET = 3
"""Errors only: onnxruntime warns of every device that is not there."""
_BLOCK = 1 << 20


class Session:
    """A loaded model. Not thread-safe."""

    def __init__(self, path: Path, device: Device = "auto", threads: int = 0, cache: Path | None = None) -> None:
        """threads: 0 for as many as there are cores. cache: where TensorRT keeps what it built, which takes minutes.

        ModelUnreadable, RuntimeMissing.
        """
        self._ort = runtime()
        self._errors = _errors()
        _refuse_other_files(path)
        self._session = self._open(path, device, threads, cache)
        self._outputs = [output.name for output in self._session.get_outputs()]
        self.device: str = _device(self._session.get_providers()[0])
        """Of PROVIDERS: the one that is in use."""
        if device not in ("auto", self.device):
            raise RuntimeMissing(
                f"{path.name}: {device!r} was asked for and could not be started, only {self.device!r}; "
                f"set detection.device to 'auto', or install what {PROVIDERS[device]} needs"
            )

    @property
    def inputs(self) -> Sequence[Any]:
        """name, shape (a text or None for a side that is open) and type of each."""
        found: Sequence[Any] = self._session.get_inputs()
        return found

    @property
    def outputs(self) -> Sequence[str]:
        """Names."""
        return self._outputs

    @property
    def metadata(self) -> dict[str, str]:
        """What the exporter wrote."""
        found: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        return found

    def run(self, name: str, blob: npt.NDArray[np.floating]) -> list[npt.NDArray[np.floating]]:
        """Every output. InferenceFailed."""
        try:
            found: list[npt.NDArray[np.floating]] = self._session.run(self._outputs, {name: blob})
        except self._errors as error:
            raise InferenceFailed(f"onnxruntime on {self.device} gave up: {_first_line(error)}") from error
        return found

    def _open(self, path: Path, device: Device, threads: int, cache: Path | None) -> Any:
        options = self._ort.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        options.log_severity_level = _QUIET
        # Waiting threads that spin would take the odometry's processor time.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        wanted = _providers(self._ort.get_available_providers(), device, cache)
        try:
            return self._ort.InferenceSession(str(path), options, providers=wanted, enable_fallback=0)
        except self._errors as error:
            raise ModelUnreadable(
                f"{path}: not a model that onnxruntime {self._ort.__version__} can load ({_first_line(error)}); "
                "expected a complete ONNX file: copy it again, or export it with an older opset"
            ) from error


def runtime() -> Any:
    """The module. RuntimeMissing says what to install."""
    try:
        return importlib.import_module("onnxruntime")
    except ImportError as error:
        raise RuntimeMissing(
            "detection needs onnxruntime, which is not installed: `pip install 'mapforest[cpu]'`, or on a Jetson "
            "NVIDIA's onnxruntime-gpu (docs/detection.md); never both"
        ) from error


def sha256(path: Path) -> str:
    """Of the model, and of the weights where they stand in files beside it. ModelUnreadable."""
    digest = hashlib.sha256()
    try:
        for part in (path, *sorted(path.parent.glob(f"{path.name}?data"))):
            with part.open("rb") as file:
                while block := file.read(_BLOCK):
                    digest.update(block)
    except OSError as error:
        raise _unreadable(path, error) from error
    return digest.hexdigest()


def _providers(available: Sequence[str], device: Device, cache: Path | None) -> list[Any]:
    """In order of speed, each with those after it to fall back on."""
    known = list(PROVIDERS)
    start = 0 if device == "auto" else known.index(device)
    return [(PROVIDERS[name], _options(name, cache)) for name in known[start:] if PROVIDERS[name] in available]


def _options(device: str, cache: Path | None) -> dict[str, str]:
    if device != "tensorrt" or cache is None:
        return {}
    try:
        cache.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RuntimeMissing(f"{cache}: cannot be made ({error.strerror}); set detection.cache") from error
    folder = str(cache)
    return {
        "trt_fp16_enable": "True",
        "trt_engine_cache_enable": "True",
        "trt_engine_cache_path": folder,
        "trt_timing_cache_enable": "True",
        "trt_timing_cache_path": folder,
    }


def _device(provider: str) -> str:
    return next((name for name, known in PROVIDERS.items() if known == provider), provider)


def _refuse_other_files(path: Path) -> None:
    try:
        with path.open("rb") as file:
            head = file.read(64)
    except OSError as error:
        raise _unreadable(path, error) from error
    if not head:
        raise ModelUnreadable(f"{path}: is empty, expected an ONNX file; copy it again")
    if head.startswith(b"PK"):
        raise ModelUnreadable(
            f"{path}: is a zip archive (a PyTorch checkpoint is one), expected an ONNX file; export it"
        )
    if head.startswith(_LFS):
        raise ModelUnreadable(f"{path}: is a pointer of Git LFS, expected an ONNX file; run `git lfs pull`")


def _unreadable(path: Path, error: OSError) -> ModelUnreadable:
    return ModelUnreadable(f"{path}: cannot be read ({error.strerror}); give the path of an ONNX file")


def _errors() -> tuple[type[Exception], ...]:
    """Everything onnxruntime raises: its own errors have no base."""
    state = importlib.import_module("onnxruntime.capi.onnxruntime_pybind11_state")
    own = [kind for kind in vars(state).values() if isinstance(kind, type) and issubclass(kind, Exception)]
    return (*own, RuntimeError, ValueError)


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0][:300]
