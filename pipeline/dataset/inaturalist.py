"""iNaturalist: what the CSV of its export site and the JSON of its API say of photos, and which file is which photo."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Any

import msgspec

from pipeline.dataset.errors import DatasetError
from pipeline.dataset.licences import licence_code, non_commercial

_PHOTO_IN_URL = re.compile(r"/photos/(\d+)/")
_NEEDED = ("id", "license", "image_url")


@dataclass(frozen=True, slots=True)
class Photo:
    """One photo of an observation. licence: code, "" for all rights reserved.

    own_licence: the licence is of the photo; the CSV knows that of the observation only. obscured: the position is
    blurred on purpose.
    """

    photo_id: str
    observation_id: str
    licence: str
    own_licence: bool
    attribution: str
    user: str
    taken_ns: int | None
    latitude_deg: float | None
    longitude_deg: float | None
    obscured: bool
    taxon: str
    quality_grade: str
    url: str


class _User(msgspec.Struct):
    login: str = ""
    name: str | None = None


class _Taxon(msgspec.Struct):
    name: str = ""


class _Shot(msgspec.Struct):
    id: int
    license_code: str | None = None
    attribution: str | None = None


class _Observation(msgspec.Struct):
    """Of `GET /v1/observations`. location: "latitude,longitude"."""

    id: int
    photos: list[_Shot] = []
    user: _User = msgspec.field(default_factory=_User)
    taxon: _Taxon | None = None
    time_observed_at: str | None = None
    observed_on: str | None = None
    location: str | None = None
    obscured: bool = False
    geoprivacy: str | None = None
    taxon_geoprivacy: str | None = None
    quality_grade: str = ""
    uri: str | None = None


class _Page(msgspec.Struct):
    results: list[_Observation]


def read_observations(document: bytes, where: str) -> list[Photo]:
    """Of a CSV or JSON file, told apart by its first letter. DatasetError names file and line."""
    text = document.decode("utf-8-sig", errors="replace").lstrip()
    return list(_json(text.encode(), where) if text[:1] in ("{", "[") else _csv(text, where))


def _json(document: bytes, where: str) -> Iterator[Photo]:
    try:
        whole = msgspec.json.decode(document)
        observations = (
            msgspec.convert(whole, list[_Observation])
            if isinstance(whole, list)
            else msgspec.convert(whole, _Page).results
        )
    except msgspec.MsgspecError as error:
        raise DatasetError(f"{where}: not what the API answers ({error})") from error
    for one in observations:
        latitude, longitude = _location(one.location)
        for shot in one.photos:
            code = licence_code(shot.license_code)
            yield Photo(
                photo_id=str(shot.id),
                observation_id=str(one.id),
                licence=code,
                own_licence=True,
                attribution=shot.attribution or _attribution(one.user.name or one.user.login, code),
                user=one.user.login,
                taken_ns=_time(one.time_observed_at or one.observed_on),
                latitude_deg=latitude,
                longitude_deg=longitude,
                obscured=one.obscured or _blurred(one.geoprivacy, one.taxon_geoprivacy),
                taxon=one.taxon.name if one.taxon else "",
                quality_grade=one.quality_grade,
                url=one.uri or "",
            )


def _csv(text: str, where: str) -> Iterator[Photo]:
    rows = csv.DictReader(io.StringIO(text))
    missing = [name for name in _NEEDED if name not in (rows.fieldnames or ())]
    if missing:
        raise DatasetError(
            f"{where}:1: no column {', '.join(missing)}; choose id, license, image_url, user_login, observed_on, "
            "latitude, longitude and coordinates_obscured when you export"
        )
    for row in rows:
        photo = _PHOTO_IN_URL.search(row["image_url"] or "")
        if photo is None:  # an observation of a sound, or without any evidence
            continue
        if not (row["id"] or "").isdigit():
            raise DatasetError(f"{where}:{rows.line_num}: id {row['id']!r} is not the number of an observation")
        yield _of_row(row, photo[1], f"{where}:{rows.line_num}")


def _of_row(row: Mapping[str, str | None], photo_id: str, where: str) -> Photo:
    code = licence_code(row["license"])
    blurred = _blurred(row.get("geoprivacy"), row.get("taxon_geoprivacy"))
    return Photo(
        photo_id=photo_id,
        observation_id=row["id"] or "",
        licence=code,
        own_licence=False,
        attribution=_attribution(row.get("user_name") or row.get("user_login") or "", code),
        user=row.get("user_login") or "",
        taken_ns=_time(row.get("time_observed_at") or row.get("observed_on")),
        latitude_deg=_degrees(row.get("latitude"), where),
        longitude_deg=_degrees(row.get("longitude"), where),
        obscured=blurred or (row.get("coordinates_obscured") or "").lower() == "true",
        taxon=row.get("scientific_name") or "",
        quality_grade=row.get("quality_grade") or "",
        url=row.get("url") or "",
    )


def merged(photos: Iterable[Photo]) -> dict[str, Photo]:
    """By photo id. What several files say of a photo counts once, and what knows its own licence counts most."""
    found: dict[str, Photo] = {}
    for photo in photos:
        known = found.get(photo.photo_id)
        if known is None or (photo.own_licence and not known.own_licence):
            found[photo.photo_id] = photo
    return found


def photo_of(path: str, photos: Mapping[str, Photo], by_observation: Mapping[str, Sequence[Photo]]) -> Photo | None:
    """The photo a downloaded file is, by the numbers in its path; None where they name none, or not one alone.

    `<photo>.jpg`, `<photo>/original.jpg`, `<observation>_<photo>.jpg`, and `<observation>.jpg` where it has one photo.
    """
    numbers = set(re.findall(r"\d+", path))
    named = {photos[number].photo_id: photos[number] for number in numbers if number in photos}
    observed = [by_observation[number] for number in numbers if number in by_observation]
    certain = {one.photo_id for group in observed for one in group if one.photo_id in named}
    if len(certain) == 1:
        return named[certain.pop()]
    if len(named) == 1 and not observed:
        return next(iter(named.values()))
    if len(observed) == 1 and not named and len(observed[0]) == 1:
        return observed[0][0]
    return None


def _location(text: str | None) -> tuple[float | None, float | None]:
    parts = (text or "").split(",")
    if len(parts) != 2:
        return None, None
    return float(parts[0]), float(parts[1])


def _degrees(text: str | None, where: str) -> float | None:
    try:
        return float(text) if text else None
    except ValueError as error:
        raise DatasetError(f"{where}: {text!r} is not a latitude or longitude") from error


def _blurred(*privacies: str | None) -> bool:
    return not {"obscured", "private"}.isdisjoint(privacies)


def _time(text: str | None) -> int | None:
    """UTC; of a day alone its noon, near enough for what is compared with it."""
    if not text:
        return None
    try:
        found = datetime.fromisoformat(text.strip().replace(" UTC", "+00:00").replace("Z", "+00:00"))
    except ValueError:
        return None
    if len(text.strip()) == 10:
        found = found.replace(hour=12)
    if found.tzinfo is None:
        found = found.replace(tzinfo=timezone.utc)
    return int(found.timestamp()) * 1_000_000_000


def _attribution(who: str, code: str) -> str:
    return f"{who}, no rights reserved (CC0)" if code == "cc0" else f"(c) {who}, some rights reserved ({code.upper()})"


def observation_groups(photos: Iterable[Photo]) -> dict[str, list[Photo]]:
    """By observation id."""
    groups: dict[str, list[Photo]] = {}
    for photo in photos:
        groups.setdefault(photo.observation_id, []).append(photo)
    return groups


def as_record_fields(photo: Photo) -> dict[str, Any]:
    """What the manifest keeps of it."""
    return {
        "source": "inaturalist",
        "stamp_ns": photo.taken_ns,
        "latitude_deg": photo.latitude_deg,
        "longitude_deg": photo.longitude_deg,
        "obscured": photo.obscured,
        "group": f"inaturalist {photo.observation_id}",
        "licence": photo.licence,
        "attribution": photo.attribution,
        "url": photo.url,
        "taxon": photo.taxon,
        "non_commercial": non_commercial(photo.licence),
    }
