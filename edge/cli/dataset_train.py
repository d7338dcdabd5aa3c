"""From a dataset to a model: drives a trainer that is installed apart."""

from __future__ import annotations

import argparse
from pathlib import Path

from edge.cli import exit_codes
from edge.cli.steps import Step, tell
from edge.cli.words import console
from edge.errors import UsageError


def _train_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("dataset", type=Path)
    parser.add_argument(
        "--trainer", type=Path, metavar="PATH", help="environment with ultralytics, its Python or its `yolo`"
    )
    parser.add_argument("--accept-agpl", action="store_true", help="its licence is known and accepted")
    parser.add_argument("--output", type=Path, metavar="DIR", help="a new folder (default: <dataset>_model)")
    parser.add_argument(
        "--model", default="yolov8s.pt", help="weights to begin with (downloaded by the trainer), or a .yaml for none"
    )
    parser.add_argument("--size", type=int, default=832, metavar="PX", help="of the network's input")
    parser.add_argument("--epochs", type=int, default=200)
    parser.add_argument("--rate", type=float, default=0.001, help="base learning rate")
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--device", default="", help="0, 0,1, cpu (default: the trainer chooses)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--set", dest="more", action="append", default=[], metavar="KEY=VALUE", help="for the trainer")
    parser.add_argument("--resume", action="store_true", help="go on where an earlier run stopped")
    parser.add_argument("--dry-run", action="store_true", help="write lists and recipe, and say what would be run")


def _train(args: argparse.Namespace) -> int:
    from edge.dataset.folder import DatasetFolder
    from edge.dataset.recipe import Recipe
    from edge.dataset.trainer import AGPL, find_trainer
    from edge.dataset.training import RECIPE, TrainingTask, prepare, train

    dataset = DatasetFolder.open(args.dataset)
    folder = args.dataset.absolute()
    run = args.output or folder.with_name(f"{folder.name}_model")
    if args.size % 32 or min(args.size, args.epochs, args.rate) <= 0:
        raise UsageError("--size is a multiple of 32; --epochs and --rate are above 0")
    recipe = Recipe(args.model, args.size, args.epochs, args.rate, "AdamW", args.batch, args.seed, args.device)
    task = TrainingTask(run, recipe, args.more, args.resume)
    if args.dry_run:
        prepare(dataset, task)
        tell(args, {"recipe": str(run / RECIPE)}, [f"yolo cfg={run.absolute() / RECIPE}"])
        return exit_codes.GOOD
    trainer = find_trainer(args.trainer)
    if not args.accept_agpl:
        raise UsageError(f"{AGPL}\nTo go on, add --accept-agpl.")
    console(stderr=True).print(f"{AGPL}\n{trainer.program} works in {run}", highlight=False, markup=False)
    card = train(dataset, task, trainer)
    metrics = ", ".join(f"{name} {value:.3f}" for name, value in card.metrics.items() if name != "epoch")
    lines = [
        f"{run / card.model}: {', '.join(card.classes)}; validation {metrics}",
        f"  {run / 'card.md'}: data, recipe, versions, licences",
    ]
    tell(args, card, lines)
    return exit_codes.GOOD


STEPS: dict[str, Step] = {
    "train": ("a detector, by ultralytics in an environment of its own, as ONNX with a card", _train_options, _train)
}
