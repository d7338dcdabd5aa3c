"""Photos downloaded from iNaturalist into a dataset, with what their observers allow."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from edge.dataset.folder import DatasetFolder, record_of
from edge.dataset.image import ImageFacts, image_facts, image_files
from edge.errors import FormatError
from pipeline.dataset.errors import DatasetError
from pipeline.dataset.hashes import HashIndex
from pipeline.dataset.inaturalist import (
    Photo,
    as_record_fields,
    merged,
    observation_groups,
    photo_of,
    read_observations,
)
from pipeline.dataset.licences import non_commercial
from pipeline.dataset.record import ImageRecord

RESEARCH = "research"


@dataclass(frozen=True, slots=True)
class PhotoRules:
    """any_grade: also observations that are not of research grade. without_nc: leave non-commercial licences out.

    most: photos of one observation, 0 for all.
    """

    any_grade: bool = False
    without_nc: bool = False
    most: int = 0


class PhotosReport(msgspec.Struct):
    """What came in and what did not, files each."""

    files: int = 0
    added: int = 0
    already: int = 0
    observations: int = 0
    """Of the added ones."""
    reserved: int = 0
    """All rights reserved, or a licence nobody knows: left out."""
    non_commercial: int = 0
    """Added, or left out if that was asked for."""
    other_grade: int = 0
    alike: int = 0
    """The same picture again, also of another observation: left out."""
    too_many: int = 0
    obscured: int = 0
    licence_of_observation: int = 0
    """Added on the word of the CSV, which knows no licence of the photo itself."""
    without_file: int = 0
    """Photos of the observations that were not downloaded."""
    unknown: tuple[str, ...] = ()
    """Files that are no photo of these observations, or not one alone."""
    unreadable: tuple[str, ...] = ()


def take_photos(
    photos: Path,
    observations: Sequence[Path],
    dataset: DatasetFolder,
    rules: PhotoRules,
    advance: Callable[[float], None],
) -> PhotosReport:
    """Add the photos below a folder; `dataset.save` is done here. FormatError for observations that cannot be read."""
    told = [photo for path in observations for photo in _read(path)]
    # The largest first: of two copies of a picture the better one stays.
    files = sorted(image_files(photos), key=lambda path: (-path.stat().st_size, str(path)))
    if not files:
        raise FormatError(f"{photos}: there are no images in it")
    return _Taking(photos, merged(told), dataset, rules).run(files, advance)


def _read(path: Path) -> list[Photo]:
    try:
        return read_observations(path.read_bytes(), str(path))
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror})") from error
    except DatasetError as error:
        raise FormatError(str(error)) from error


@dataclass
class _Taking:
    root: Path
    photos: dict[str, Photo]
    dataset: DatasetFolder
    rules: PhotoRules
    report: PhotosReport = field(default_factory=PhotosReport)
    digests: set[str] = field(default_factory=set)
    hashes: HashIndex = field(default_factory=HashIndex)
    groups: Counter[str] = field(default_factory=Counter)
    added: set[str] = field(default_factory=set)

    def run(self, files: Sequence[Path], advance: Callable[[float], None]) -> PhotosReport:
        report, groups, seen = self.report, observation_groups(self.photos.values()), set[str]()
        report.files = len(files)
        for record in self.dataset.records:
            self._know(record)
        for number, path in enumerate(files):
            advance(number / len(files))
            relative = str(path.relative_to(self.root))
            photo = photo_of(relative, self.photos, groups)
            if photo is None:
                report.unknown += (relative,)
            else:
                seen.add(photo.photo_id)
                self._take(path, photo)
        self.dataset.save()
        report.without_file = len(set(self.photos) - seen)
        report.observations = len(self.added)
        return report

    def _take(self, path: Path, photo: Photo) -> None:
        if not self._allowed(photo):
            return
        data = path.read_bytes()
        try:
            facts = image_facts(data, str(path))
        except FormatError as error:
            self.report.unreadable += (str(error),)
            return
        if self._there(facts, photo):
            return
        name = f"inaturalist_{photo.observation_id}_{photo.photo_id}{path.suffix.lower()}"
        record = record_of(name, facts, **as_record_fields(photo))
        self.dataset.add(record, data)
        self._know(record)
        self.added.add(record.group)
        self.report.added += 1
        self.report.non_commercial += record.non_commercial
        self.report.obscured += photo.obscured
        self.report.licence_of_observation += not photo.own_licence

    def _allowed(self, photo: Photo) -> bool:
        report, rules = self.report, self.rules
        if not photo.licence:
            report.reserved += 1
            return False
        if photo.quality_grade not in ("", RESEARCH) and not rules.any_grade:
            report.other_grade += 1
            return False
        if rules.without_nc and non_commercial(photo.licence):
            report.non_commercial += 1
            return False
        return True

    def _there(self, facts: ImageFacts, photo: Photo) -> bool:
        """Whether the dataset has the picture, or enough of its observation."""
        if facts.sha256 in self.digests:
            self.report.already += 1
            return True
        if self.hashes.near(facts.phash):
            self.report.alike += 1
            return True
        if self.rules.most and self.groups[f"inaturalist {photo.observation_id}"] >= self.rules.most:
            self.report.too_many += 1
            return True
        return False

    def _know(self, record: ImageRecord) -> None:
        self.digests.add(record.sha256)
        self.hashes.add(record.phash)
        self.groups[record.group] += 1
