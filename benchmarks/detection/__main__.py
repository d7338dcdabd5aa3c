"""The detector beside a bare run of its network on the same frames, in turn; prints a table in Markdown.

    python -m benchmarks.detection [MODEL.onnx ...] [--threads 1] [--device auto] [--frames 40]

Without a model: networks with half the multiplications of YOLOv8n, of several input sizes. Frames are rendered by the
simulated camera. With one thread the times are of the processor: other work disturbs them less.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np

from benchmarks.detection import standin
from drivers.sim.camera import Camera
from drivers.sim.renderer import Renderer
from drivers.sim.scenarios import scenario
from drivers.sim.world import build
from pipeline.detection.detector import Detector, Settings
from pipeline.detection.letterbox import Letterbox

INPUTS_PX = ((288, 512), (480, 832), (640, 640), (832, 832))
WARM = 3


def main() -> None:
    options = _options()
    cv2.setNumThreads(options.threads)  # its threads' time would not be counted
    images = list(_images(options.frames))
    print("| model | input | images | bare ms | detector ms | over it | put in | boxes an image |")
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        paths = options.models or [
            standin.write(Path(folder) / f"standin_{height}x{width}.onnx", (height, width))
            for height, width in INPUTS_PX
        ]
        for path in paths:
            print(_row(path, images, options), flush=True)


def _row(path: Path, images: list[np.ndarray], options: argparse.Namespace) -> str:
    detector = Detector(path, Settings(device=options.device, threads=options.threads))
    clock = time.thread_time if options.threads == 1 and detector.info.device == "cpu" else time.perf_counter
    bare, whole, boxes = _paired(detector, images, clock)
    put_in = [_took(lambda image=image: detector._box.put(image), clock) for image in images]
    over = float(np.median(whole / bare)) - 1.0
    height, width = detector._box.blob.shape[2:]
    return (
        f"| {path.stem} | {height} x {width} | {images[0].shape[0]} x {images[0].shape[1]} | {np.median(bare):.1f} | "
        f"{np.median(whole):.1f} | {over:+.1%} | {np.median(put_in):.2f} | {boxes / len(images):.1f} |"
    )


def _paired(
    detector: Detector, images: list[np.ndarray], clock: Callable[[], float]
) -> tuple[np.ndarray, np.ndarray, int]:
    """Milliseconds (n,) of the network alone and of everything, whichever comes first taking turns; boxes found."""
    bare, whole, found = [], [], []
    for k, image in enumerate([*images[:WARM], *images]):
        box: Letterbox = detector._letterbox(image.shape[:2])
        box.put(image)

        def network(box: Letterbox = box) -> None:
            detector._session.run(detector._name, box.blob)

        def everything(image: np.ndarray = image) -> None:
            found.append(len(detector.detect(image, 0)))

        pairs = [(network, bare), (everything, whole)]
        for work, times in pairs if k % 2 else pairs[::-1]:
            times.append(_took(work, clock))
    return np.array(bare[WARM:]), np.array(whole[WARM:]), sum(found[WARM:])


def _took(work: Callable[[], object], clock: Callable[[], float]) -> float:
    began = clock()
    work()
    return (clock() - began) * 1e3


def _images(count: int) -> Iterator[np.ndarray]:
    world = build(scenario("demo", None))
    renderer = Renderer(world.scene, world.trajectory, Camera(), world.config.seed)
    for k in range(count):
        yield cv2.cvtColor(renderer.render((10 + k) * 500_000_000), cv2.COLOR_RGB2BGR)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.detection", description=__doc__)
    parser.add_argument("models", type=Path, nargs="*", metavar="MODEL")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--device", default="auto", choices=["auto", "tensorrt", "cuda", "cpu"])
    parser.add_argument("--frames", type=int, default=40)
    return parser.parse_args()


if __name__ == "__main__":
    main()
