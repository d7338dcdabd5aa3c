"""Is a dataset whole: files, labels, licences, splits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator

import msgspec

from edge.dataset.folder import IMAGES, LABELS, DatasetFolder
from edge.dataset.image import ENDINGS, image_facts
from edge.errors import FormatError
from edge.validation.report import Finding, Level
from pipeline.dataset.labels import Labels
from pipeline.dataset.neighbours import WORDS, Gap, leaks
from pipeline.dataset.record import SPLITS, ImageRecord

_SHOWN = 3


class CheckReport(msgspec.Struct):
    """Findings, the worst first."""

    findings: list[Finding]

    @property
    def level(self) -> Level:
        """Of the worst."""
        return max((one.level for one in self.findings), default=Level.NOTE)


def check(dataset: DatasetFolder, gap: Gap, *, quick: bool = False) -> CheckReport:
    """quick: without reading the pictures."""
    labels = [dataset.labels(record) for record in dataset.records]
    findings = [
        *_files(dataset),
        *([] if quick else _pictures(dataset)),
        *_labels(dataset, labels),
        *_splits(dataset.records, labels, gap),
        *_rights(dataset.records),
    ]
    return CheckReport(sorted(findings, key=lambda one: one.level, reverse=True))


def _files(dataset: DatasetFolder) -> Iterator[Finding]:
    on_disk = {p.name for p in (dataset.folder / IMAGES).iterdir() if p.suffix.lower() in ENDINGS}
    listed = {record.image for record in dataset.records}
    stems = Counter(record.stem for record in dataset.records)
    texts = {p.stem for p in (dataset.folder / LABELS).glob("*.txt")}
    yield from _found(Level.FAIL, listed - on_disk, "images of the manifest are not in images/", "copy them back")
    yield from _found(
        Level.WARN,
        on_disk - listed,
        "images are not in the manifest",
        "move them out of images/, and take them in with their labels (`mapforest dataset labels`)",
    )
    yield from _found(Level.WARN, texts - set(stems), "labels have no image", "an image was renamed or removed")
    twice = [stem for stem, count in stems.items() if count > 1]
    yield from _found(Level.FAIL, twice, "names are of two images, which share one label file", "rename one of each")
    bare = [record.image for record in dataset.records if record.stem not in texts]
    yield from _found(Level.NOTE, bare, "images have no labels yet; no trainer is given them", "")


def _pictures(dataset: DatasetFolder) -> Iterator[Finding]:
    broken, changed, wrong = [], [], []
    digests: Counter[str] = Counter()
    for record in dataset.records:
        path = dataset.image_path(record)
        if not path.exists():
            continue
        try:
            facts = image_facts(path.read_bytes(), record.image)
        except FormatError as error:
            broken.append(str(error))
            continue
        digests[facts.sha256] += 1
        changed += [record.image] * (facts.sha256 != record.sha256)
        wrong += [record.image] * ((facts.width_px, facts.height_px) != (record.width_px, record.height_px))
    yield from _found(Level.FAIL, broken, "images cannot be read", "")
    yield from _found(Level.FAIL, wrong, "images have another size than they had", "are their labels of other images?")
    yield from _found(Level.WARN, sorted(set(changed) - set(wrong)), "images changed since they were taken in", "")
    twice = [digest[:12] for digest, count in digests.items() if count > 1]
    yield from _found(Level.WARN, twice, "images are there twice, byte for byte", "remove one of each")


def _labels(dataset: DatasetFolder, labels: list[Labels | None]) -> Iterator[Finding]:
    known = [one for one in labels if one is not None]
    yield from _found(Level.FAIL, [p for one in known for p in one.problems], "lines of labels are no boxes", "")
    if known and not dataset.classes:
        yield Finding(Level.FAIL, "", "there are labels but no classes.txt", "write it: a name a row, row 0 first")
    cut = [r.image for r, one in zip(dataset.records, labels, strict=True) if one is not None and one.clipped]
    yield from _found(Level.NOTE, cut, "images have boxes over their edge; they are cut there", "")
    counts = Counter(box.class_id for one in known for box in one.boxes)
    empty = [name for number, name in enumerate(dataset.classes) if not counts[number]]
    yield from _found(Level.WARN, empty, "classes have no box", "a detector cannot learn them; take them out")


def _splits(records: list[ImageRecord], labels: list[Labels | None], gap: Gap) -> Iterator[Finding]:
    if not any(record.split in SPLITS for record in records):
        yield Finding(Level.NOTE, "", "not divided yet", "mapforest dataset split")
        return
    boxes = Counter[str]()
    for record, one in zip(records, labels, strict=True):
        boxes[record.split] += len(one.boxes) if one is not None else 0
    for split in ("train", "val"):
        if not boxes[split]:
            yield Finding(Level.WARN, "", f"there is no box in {split}", "label more, or divide again")
    new = [record.image for record in records if not record.split]
    yield from _found(Level.WARN, new, "images are in no split", "mapforest dataset split --keep")
    kinds: dict[str, list[str]] = {}
    for pair in leaks(records, gap):
        words = [f"{records[place].image} ({records[place].split})" for place in (pair.i, pair.j)]
        kinds.setdefault(WORDS[pair.kind], []).append(" and ".join(words))
    for kind, pairs in kinds.items():
        yield from _found(Level.WARN, pairs, f"pairs of images are in different splits but {kind}", "divide again")


def _rights(records: list[ImageRecord]) -> Iterator[Finding]:
    bare = [r.image for r in records if r.source == "inaturalist" and not r.licence]
    yield from _found(Level.FAIL, bare, "photos have no licence", "take them out, or ask their authors")
    nc = [record.image for record in records if record.non_commercial]
    advice = "whether that binds a model is not settled: ask, or use others"
    yield from _found(Level.NOTE, nc, "photos are for non-commercial use only", advice)


def _found(level: Level, names: Collection[str], words: str, advice: str) -> Iterator[Finding]:
    """One finding with its count and the first few names; none of nothing."""
    if several := sorted(names):
        shown = ", ".join(several[:_SHOWN]) + (", ..." if len(several) > _SHOWN else "")
        yield Finding(level, "", f"{len(several)} {words}: {shown}", advice)
