"""The demonstration detector from nothing to the file in the repository, step by step.

python -m training.demo_detector render FOLDER              film walks to train on and to be measured on
python -m training.demo_detector train FOLDER RUN           goes on where it was stopped
python -m training.demo_detector export RUN MODEL CONFIDENCE
python -m training.demo_detector score FOLDER MODEL         the tables of the model card

CONFIDENCE is the least that the model will advise: export, score, and choose it from the table.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from training.demo_detector import dataset
from training.demo_detector.walks import TRAINING_SEEDS, VALIDATION_SEEDS, filmed, held_out_walk, sampled, training_walk

EVERY_M = 3.0
EVERY_FRAME = 10
"""Three of the camera's thirty a second."""
TRAINING, HELD_OUT = "training", "held_out"


def main() -> None:
    """Parse the command line and do one step."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    steps = parser.add_subparsers(required=True, metavar="STEP")
    for step, names in (
        (render, ("folder",)),
        (train, ("folder", "run")),
        (export, ("run", "model", "confidence")),
        (score, ("folder", "model")),
    ):
        one = steps.add_parser(step.__name__, help=step.__doc__)
        one.set_defaults(step=step)
        for name in names:
            one.add_argument(name, type=float if name == "confidence" else Path)
    options = vars(parser.parse_args())
    options.pop("step")(**options)


def render(folder: Path) -> None:
    """Film all walks; those that are there already are left as they are."""
    for seed in (*VALIDATION_SEEDS, *TRAINING_SEEDS):
        held_out = seed in VALIDATION_SEEDS
        target = folder / (HELD_OUT if held_out else TRAINING) / str(seed)
        if not (target / dataset.TABLE).exists():
            shots = filmed(held_out_walk(seed), EVERY_FRAME) if held_out else sampled(training_walk(seed), EVERY_M)
            print(f"walk {seed}: {dataset.write(shots, target)} pictures", flush=True)


def train(folder: Path, run: Path) -> None:
    """Train on the walks of a folder, or go on with it; the state is kept in RUN."""
    from training.demo_detector import train as training

    walks = dataset.walks(folder / TRAINING)
    training.train([one for walk in walks for one in dataset.pictures(walk)], training.Recipe(), run)


def export(run: Path, model: Path, confidence: float) -> None:
    """Write the trained network as ONNX, and the least confidence it advises inside."""
    from training.demo_detector.export import export as write
    from training.demo_detector.train import Recipe, trained

    write(trained(run), Recipe().input_px, confidence, model)


def score(folder: Path, model: Path) -> None:
    """Measure a model on the held-out walks."""
    from training.demo_detector.report import report

    print(report(model, dataset.walks(folder / HELD_OUT)))


if __name__ == "__main__":
    main()
