"""Labels from Label Studio into a dataset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import msgspec

from edge.dataset.exports import Export
from edge.dataset.folder import DatasetFolder, read_text, record_of, refuse
from edge.dataset.image import digest, image_facts
from edge.dataset.matching import Matching, readings
from edge.errors import EdgeError, FormatError
from pipeline.dataset.label_studio import Marked
from pipeline.dataset.labels import Box, format_labels
from pipeline.dataset.record import ImageRecord, Source


@dataclass(frozen=True, slots=True)
class Choices:
    """labeler: whose word counts where several differ. empty: what a file without boxes means. site, source: of images
    that come with the export. skip_broken: leave images with a line that is no box unlabelled, instead of refusing.
    """

    labeler: str = ""
    empty: Literal["negative", "unlabelled"] = "negative"
    replace: bool = False
    skip_broken: bool = False
    site: str = ""
    source: Source = "other"


class LabelsReport(msgspec.Struct):
    """What came in. unmatched: labels of which nobody knows the image. broken: lines that were left out."""

    labelled: int = 0
    boxes: int = 0
    negatives: int = 0
    unchanged: int = 0
    replaced: int = 0
    added_images: int = 0
    polygons: int = 0
    clipped: int = 0
    ignored: dict[str, int] = {}
    new_classes: tuple[str, ...] = ()
    unmatched: tuple[str, ...] = ()
    without_labels: tuple[str, ...] = ()
    """Pictures of the export that have no label file; they are left there."""
    broken: tuple[str, ...] = ()
    unlabelled: int = 0
    """Images of the dataset that still have no labels."""


def take_labels(export: Export, dataset: DatasetFolder, choices: Choices) -> LabelsReport:
    """Write the labels of every image that is known or came along; `dataset.save` is done here. FormatError."""
    return _Taking(export, dataset, choices).run()


@dataclass(frozen=True, slots=True)
class _Picture:
    """An image that came with the export."""

    name: str
    sha256: str
    data: bytes


@dataclass
class _Taking:
    export: Export
    dataset: DatasetFolder
    choices: Choices
    report: LabelsReport = field(default_factory=LabelsReport)

    def run(self) -> LabelsReport:
        problems = [problem for one in self.export.marked for problem in one.problems]
        if not self.choices.skip_broken:
            refuse(problems)
        self.report.broken = tuple(problems)
        known, new, unmatched = self._sorted()
        self._classes([*known.values(), *new.values()])
        labels = {image: self._boxes(one) for image, one in known.items()}
        self._refuse_changes(labels)
        for image, one in new.items():
            labels[self._added(image).image] = self._boxes(one)
        records = {record.image: record for record in self.dataset.records}
        for image, boxes in labels.items():
            self.dataset.set_labels(records[image], boxes)
        self.dataset.save()
        self.report.unmatched = tuple(unmatched)
        named = {stem for one in self.export.marked for stem in readings(one.image)}
        self.report.without_labels = tuple(sorted(set(self.export.images) - named))
        self.report.unlabelled = sum(1 for r in self.dataset.records if not self.dataset.label_path(r).exists())
        return self.report

    def _sorted(self) -> tuple[dict[str, Marked], dict[str, Marked], list[str]]:
        """The word on each image of the dataset, on each that came along, and on what nobody knows."""
        matching = Matching(self.dataset.records)
        by_bytes = {record.sha256: record for record in self.dataset.records}
        several: dict[tuple[bool, str], list[Marked]] = {}
        unmatched = []
        for one in self.export.marked:
            picture = self._picture(one.image)
            record = (by_bytes.get(picture.sha256) if picture else None) or matching.find(one.image)
            if record is not None:
                several.setdefault((True, record.image), []).append(one)
            elif picture is not None:
                several.setdefault((False, one.image), []).append(one)
            else:
                unmatched.append(one.image)
        agreed = {key: self._agreed(key[1], marked) for key, marked in several.items()}
        taken = {k: one for k, one in agreed.items() if not one.problems and (one.boxes or self._empty_is_negative)}
        return (
            {image: one for (there, image), one in taken.items() if there},
            {image: one for (there, image), one in taken.items() if not there},
            unmatched,
        )

    @property
    def _empty_is_negative(self) -> bool:
        return self.choices.empty == "negative"

    def _agreed(self, image: str, several: Sequence[Marked]) -> Marked:
        """The one word on an image."""
        decided = [one for one in several if one.decided]
        mine = [one for one in several if one.labeler == self.choices.labeler]
        if len(decided) == 1:
            return decided[0]
        if self.choices.labeler and mine:
            return mine[0]
        if len({frozenset(one.boxes) for one in several}) > 1:
            who = ", ".join(sorted(one.labeler or "nobody named" for one in several))
            raise FormatError(
                f"{image}: labelled differently by {who}; choose with --labeler, or mark one as ground truth in Label "
                "Studio and export as JSON"
            )
        return several[0]

    def _classes(self, wanted: Sequence[Marked]) -> None:
        """All of the export's into a dataset without, else those that boxes have. Letter case does not matter."""
        used = {name for one in wanted for name, _ in one.boxes}
        coming = [name for name in self.export.classes if name in used or not self.dataset.classes]
        known = {name.lower(): name for name in self.dataset.classes}
        new = {name.lower(): name for name in coming if name.lower() not in known}
        self.report.new_classes = tuple(new.values())
        self.dataset.classes += new.values()

    def _picture(self, image: str) -> _Picture | None:
        found = next((self.export.images[stem] for stem in readings(image) if stem in self.export.images), None)
        if found is None:
            return None
        data = found[1]()
        return _Picture(found[0], digest(data), data)

    def _added(self, image: str) -> ImageRecord:
        picture = self._picture(image)
        assert picture is not None
        stem, _, ending = picture.name.rpartition(".")
        taken = any(record.stem == stem for record in self.dataset.records)
        record = record_of(
            f"{stem[:200]}_{picture.sha256[:12]}.{ending}" if taken else picture.name,
            image_facts(picture.data, picture.name),
            source=self.choices.source,
            site=self.choices.site,
        )
        self.dataset.add(record, picture.data)
        self.report.added_images += 1
        return record

    def _boxes(self, one: Marked) -> list[Box]:
        """With the dataset's numbers of the classes; counted."""
        numbers = {name.lower(): number for number, name in enumerate(self.dataset.classes)}
        report, boxes = self.report, [replace(box, class_id=numbers[name.lower()]) for name, box in one.boxes]
        report.labelled += 1
        report.boxes += len(boxes)
        report.negatives += not boxes
        report.polygons += one.polygons
        report.clipped += one.clipped
        report.ignored = dict(Counter(report.ignored) + Counter(dict(one.ignored)))
        return boxes

    def _refuse_changes(self, labels: dict[str, list[Box]]) -> None:
        """EdgeError where labels that are there would be others, unless that is asked for."""
        changed = []
        for record in self.dataset.records:
            path = self.dataset.label_path(record)
            if record.image in labels and path.exists():
                same = sorted(read_text(path).split("\n")) == sorted(format_labels(labels[record.image]).split("\n"))
                self.report.unchanged += same
                changed += [] if same else [record.image]
        if changed and not self.choices.replace:
            names = ", ".join(changed[:3]) + (", ..." if len(changed) > 3 else "")
            raise EdgeError(f"{len(changed)} images have other labels already ({names}); --replace takes the export's")
        self.report.replaced = len(changed)
