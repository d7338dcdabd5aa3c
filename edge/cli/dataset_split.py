"""How a dataset is divided, what it holds, and whether it is whole."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from edge.cli import exit_codes
from edge.cli.steps import Step, out, some, table, tell
from edge.errors import UsageError

if TYPE_CHECKING:  # heavy: scipy, OpenCV
    from pipeline.dataset.statistics import Share, Statistics


def _gap_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--gap", type=float, default=20.0, metavar="M", help="metres between different splits")
    parser.add_argument("--gap-s", type=float, default=20.0, metavar="S", help="the same in time, without positions")


def _split_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("dataset", type=Path)
    parser.add_argument(
        "--shares", default="80,10,10", metavar="TRAIN,VAL,TEST", help="in percent; 0 leaves a split empty"
    )
    parser.add_argument(
        "--by",
        choices=["block", "site", "image"],
        default="block",
        help="what stays together: squares of ground (or stretches of time), whole sites, or single images",
    )
    parser.add_argument("--block", type=float, default=60.0, metavar="M", help="side of the squares")
    parser.add_argument("--block-s", type=float, default=60.0, metavar="S", help="length of the stretches of time")
    _gap_options(parser)
    parser.add_argument("--test-site", nargs="+", default=[], metavar="SITE", help="whole sites for the test")
    sources = ["field", "inaturalist", "other"]
    parser.add_argument("--train-only", nargs="+", default=[], choices=sources, help="sources kept for training")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", action="store_true", help="leave images in the split they are in, place new ones")
    parser.add_argument("--force", action="store_true", help="set nothing aside, and say what leaks")


def _split(args: argparse.Namespace) -> int:
    from edge.dataset.folder import DatasetFolder
    from pipeline.dataset.blocks import BlockSize
    from pipeline.dataset.neighbours import WORDS, Gap
    from pipeline.dataset.record import SPLITS
    from pipeline.dataset.split import Rules, divide

    dataset = DatasetFolder.open(args.dataset)
    rules = Rules(
        shares=_shares(args.shares),
        by=args.by,
        size=BlockSize(args.block, args.block_s),
        gap=Gap(args.gap, args.gap_s),
        seed=args.seed,
        test_sites=args.test_site,
        train_only=args.train_only,
        keep=args.keep,
        force=args.force,
    )
    boxes = dataset.boxes()
    division = divide(dataset.records, [None if one is None else len(one) for one in boxes], rules)
    dataset.records = division.records
    dataset.save()
    images, per_split = Counter(r.split for r in division.records), Counter[str]()
    for record, one in zip(division.records, boxes, strict=True):
        per_split[record.split] += len(one or ())
    kinds = Counter(WORDS[pair.kind] for pair in division.leaks)
    told = {
        "images": dict(images),
        "boxes": dict(per_split),
        "blocks": division.blocks,
        "set_aside": division.set_aside,
        "leaks": dict(kinds),
        "loose": division.loose,
    }
    parts = ", ".join(f"{name} {images[name]} images {per_split[name]} boxes" for name in SPLITS)
    empty = [name for name, share in zip(SPLITS, rules.shares, strict=True) if share > 0 and not images[name]]
    lines = [
        f"{args.dataset}: {parts}; {division.blocks} blocks, seed {args.seed}",
        f"  nothing is left for {', '.join(empty)}: walk more, or make --block or --gap smaller" if empty else "",
        some(division.set_aside, "images set aside, within the gap of another split"),
        some(division.loose, "images with neither place nor time: what they are near to is not known"),
        *(some(count, f"leaks, pairs in different splits but {words}") for words, count in kinds.items()),
    ]
    tell(args, told, lines)
    return exit_codes.WARNINGS if division.leaks or empty else exit_codes.GOOD


def _shares(text: str) -> tuple[float, float, float]:
    try:
        train, val, test = (float(word) / 100.0 for word in text.split(","))
    except ValueError as error:
        raise UsageError(f"--shares {text}: three numbers are expected, such as 80,10,10") from error
    if min(train, val, test) < 0 or abs(train + val + test - 1.0) > 1e-6:
        raise UsageError(f"--shares {text}: percentages from 0 that make 100 together are expected")
    return train, val, test


def _statistics_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("dataset", type=Path)


def _statistics(args: argparse.Namespace) -> int:
    from edge.dataset.folder import DatasetFolder
    from pipeline.dataset.statistics import statistics

    dataset = DatasetFolder.open(args.dataset)
    found = statistics(dataset.records, dataset.boxes(), dataset.classes)
    if args.json:
        tell(args, found, ())
    else:
        _show(found)
    return exit_codes.GOOD


def _show(found: Statistics) -> None:
    classes = list(found.total.per_class)
    console = out()
    counts = table(["", "images", "labelled", "nothing there", "boxes", *(classes if len(classes) > 1 else ())])
    for group, shares in (("split", found.by_split), ("source", found.by_source), ("site", found.by_site)):
        for name, share in shares.items():
            counts.add_row(escape(f"{group} {name}"), *_figures(share, classes))
    counts.add_row("all", *_figures(found.total, classes), style="bold")
    console.print(counts)
    sizes = found.sizes
    per_image = ", ".join(f"{boxes} in {images}" for boxes, images in found.boxes_per_image.items())
    told = [
        f"side of the boxes at 832 pixels: {sizes.small} below 32, {sizes.medium} to 96, {sizes.large} above; from "
        f"{sizes.smallest_px:.0f} over {sizes.median_px:.0f} (median) to {sizes.largest_px:.0f}",
        f"boxes in images: {per_image}",
        *(
            f"sharpness of {source}: quartiles {low:.0f}, {middle:.0f}, {high:.0f}"
            for source, (low, middle, high) in found.sharpness.items()
        ),
        "licences: " + ", ".join(f"{name} {count}" for name, count in found.licences.items()),
    ]
    for line in told if found.total.boxes else told[2:]:
        console.print(escape(line), highlight=False)


def _figures(share: Share, classes: list[str]) -> list[str]:
    per_class = [f"{share.per_class[name]:,}" for name in classes] if len(classes) > 1 else []
    return [f"{n:,}" for n in (share.images, share.labelled, share.negatives, share.boxes)] + per_class


def _check_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--quick", action="store_true", help="do not read the pictures")
    _gap_options(parser)


def _check(args: argparse.Namespace) -> int:
    from edge.dataset.check import check
    from edge.dataset.folder import DatasetFolder
    from edge.validation.report import Level
    from pipeline.dataset.neighbours import Gap

    dataset = DatasetFolder.open(args.dataset)
    report = check(dataset, Gap(args.gap, args.gap_s), quick=args.quick)
    words = {Level.FAIL: "FAIL", Level.WARN: "warn", Level.NOTE: "note"}
    lines = [
        f"  {words[one.level]} {one.text}" + (f" -> {one.advice}" if one.advice else "") for one in report.findings
    ]
    verdict = {Level.FAIL: "not to be trained with", Level.WARN: "usable", Level.NOTE: "good"}[report.level]
    tell(args, report, [f"{args.dataset}: {len(dataset.records):,} images, {verdict}", *lines])
    codes = {Level.FAIL: exit_codes.FAILED, Level.WARN: exit_codes.WARNINGS, Level.NOTE: exit_codes.GOOD}
    return codes[report.level]


STEPS: dict[str, Step] = {
    "split": ("training, validation and test, so that neighbours never straddle", _split_options, _split),
    "statistics": ("images, boxes, sizes, sharpness and licences", _statistics_options, _statistics),
    "check": ("files, labels, licences and splits: what is wrong with a dataset", _check_options, _check),
}
