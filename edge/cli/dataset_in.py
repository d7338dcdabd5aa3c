"""What brings images and labels into a dataset: recordings, Label Studio, iNaturalist."""

from __future__ import annotations

import argparse
from pathlib import Path

from edge.cli import exit_codes
from edge.cli.stage_bar import StageBar
from edge.cli.steps import Step, named, some, tell
from edge.config import load
from edge.errors import UsageError


def _frames_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("session", type=Path, nargs="+", help="session folder, bag folder or .mcap file")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="the dataset, new or to add to")
    parser.add_argument("--site", default="", help="where it was (default: the mission's name)")
    parser.add_argument("--every", type=float, default=2.0, metavar="M", help="one frame for each M metres of way")
    parser.add_argument(
        "--every-s", type=float, default=2.0, metavar="S", help="one frame for each S seconds, where there are no poses"
    )
    parser.add_argument("--quality", type=int, default=95, metavar="Q", help="of the JPEGs, 1 to 100")
    parser.add_argument(
        "--min-sharpness", type=float, default=0.0, metavar="V", help="leave out what has a lower variance of Laplacian"
    )


def _frames(args: argparse.Namespace) -> int:
    from edge.dataset.folder import DatasetFolder
    from edge.dataset.frames import FramesTask, extract

    if args.every <= 0 or args.every_s <= 0 or not 1 <= args.quality <= 100:
        raise UsageError("--every and --every-s are lengths above 0, --quality is from 1 to 100")
    config, dataset = load(args.config), DatasetFolder.make(args.output)
    reports = []
    with StageBar(quiet=args.json) as bar:
        for session in args.session:
            bar.stage(session.absolute().name[-24:], done=False)
            task = FramesTask(session, args.site, args.every, args.every_s, args.quality, args.min_sharpness)
            reports.append(extract(task, config, dataset, bar.advance))
            dataset.save()
    lines = []
    for one in reports:
        way = f"over {one.travelled_m:,.0f} m" if one.chosen_by == "distance" else "by time"
        lines += [
            f"{one.session}: {one.added} frames {way} from {one.seen:,}, site {one.site}, JPEG quality {one.quality}",
            f"  poses: {one.poses}" if one.chosen_by == "distance" else f"  chosen by time: {one.poses}",
            some(one.added - one.placed, "without a position, for want of a georeference"),
            some(one.already, "chosen again, there from an earlier run"),
            some(one.alike, "left out, they look like another one"),
            some(one.blurred, "left out, not sharp enough"),
            some(one.outside, "left out, before the first or after the last pose"),
            some(one.lost, "not decoded, before a key frame or damaged"),
        ]
    tell(args, reports, [*lines, f"{args.output}: images in all: {len(dataset.records):,}"])
    return exit_codes.GOOD if all(one.chosen_by == "distance" for one in reports) else exit_codes.WARNINGS


def _labels_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("export", type=Path, help="Label Studio's export: YOLO (folder or ZIP) or JSON")
    parser.add_argument("dataset", type=Path, help="the dataset, new or to add to")
    parser.add_argument("--images", type=Path, metavar="DIR", help="pictures that neither of them has")
    parser.add_argument("--labeler", default="", metavar="WHO", help="whose labels count where several people's differ")
    parser.add_argument(
        "--empty",
        choices=["negative", "unlabelled"],
        default="negative",
        help="what a file without boxes says: nothing is there, or nobody has looked (YOLO exports cannot tell)",
    )
    parser.add_argument("--replace", action="store_true", help="take the export's word where the dataset has another")
    parser.add_argument("--skip-broken", action="store_true", help="leave images with broken lines unlabelled")
    parser.add_argument("--site", default="", help="of pictures that come with the export")
    parser.add_argument("--source", choices=["field", "other"], default="other", help="of these pictures")


def _labels(args: argparse.Namespace) -> int:
    from edge.dataset.exports import open_export
    from edge.dataset.folder import DatasetFolder
    from edge.dataset.labelling import Choices, take_labels

    export = open_export(args.export, args.images)
    dataset = DatasetFolder.make(args.dataset)
    choices = Choices(args.labeler, args.empty, args.replace, args.skip_broken, args.site, args.source)
    report = take_labels(export, dataset, choices)
    told = f"{report.labelled:,} images with {report.boxes:,} boxes, {report.negatives:,} of them with nothing there"
    unsure = report.negatives and not args.export.name.endswith(".json") and args.empty == "negative"
    lines = [
        f"{args.dataset}: {told}",
        "  a YOLO export cannot tell an image with nothing there from one nobody opened; JSON can" if unsure else "",
        some(report.added_images, "images that came with the export"),
        some(report.replaced, "labels replaced"),
        some(report.polygons, "polygons that became their bounding boxes"),
        some(report.clipped, "boxes over the edge, cut there"),
        *(some(count, f"left out, no boxes: {kind}") for kind, count in report.ignored.items()),
        named(report.new_classes, "new classes"),
        named(report.unmatched, "labels of images that are not here (--images)"),
        named(report.without_labels, "pictures of the export without labels, left there"),
        named(report.broken, "lines that are no boxes"),
        some(report.unlabelled, "images of the dataset without labels"),
    ]
    tell(args, report, lines)
    return exit_codes.WARNINGS if report.unmatched or report.broken else exit_codes.GOOD


def _photos_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("photos", type=Path, help="folder of the photos, as downloaded: their names or folders are ids")
    parser.add_argument(
        "--observations", type=Path, nargs="+", required=True, metavar="FILE", help="CSV of the export site, API JSON"
    )
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="the dataset, new or to add to")
    parser.add_argument("--any-grade", action="store_true", help="also observations that are not of research grade")
    parser.add_argument("--without-nc", action="store_true", help="leave non-commercial licences out")
    parser.add_argument("--most", type=int, default=0, metavar="N", help="photos of one observation (default: all)")


def _photos(args: argparse.Namespace) -> int:
    from edge.dataset.folder import DatasetFolder
    from edge.dataset.photos import PhotoRules, take_photos

    rules = PhotoRules(args.any_grade, args.without_nc, args.most)
    with StageBar(quiet=args.json) as bar:
        bar.stage("photos", done=False)
        report = take_photos(args.photos, args.observations, DatasetFolder.make(args.output), rules, bar.advance)
    what = ", left out" if args.without_nc else ""
    lines = [
        f"{args.output}: {report.added:,} of {report.files:,} photos added; {report.observations:,} observations",
        some(report.reserved, "left out, all rights reserved or no licence that is known"),
        some(report.non_commercial, f"for non-commercial use only{what}"),
        some(report.other_grade, "left out, not of research grade (--any-grade)"),
        some(report.already, "there already"),
        some(report.alike, "left out, the same picture as another one"),
        some(report.too_many, "left out, enough of their observation"),
        some(report.obscured, "with a blurred position, not used to divide them"),
        some(report.licence_of_observation, "by the licence of the observation (the API's JSON knows the photo's own)"),
        some(report.without_file, "photos of the observations that were not downloaded"),
        named(report.unknown, "files that are no photo of these observations, or of several"),
        named(report.unreadable, "files that cannot be read"),
    ]
    tell(args, report, lines)
    return exit_codes.WARNINGS if report.unknown or report.unreadable or not report.added else exit_codes.GOOD


STEPS: dict[str, Step] = {
    "frames": ("frames of recordings: of each stretch of way the sharpest", _frames_options, _frames),
    "labels": ("labels from Label Studio", _labels_options, _labels),
    "inaturalist": ("photos downloaded from iNaturalist, with their licences", _photos_options, _photos),
}
