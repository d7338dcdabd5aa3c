"""Observations as iNaturalist hands them out, by samples written by hand: whose photos, under which licence, where."""

from __future__ import annotations

import json

import pytest

from pipeline.dataset.errors import DatasetError
from pipeline.dataset.inaturalist import merged, observation_groups, photo_of, read_observations
from pipeline.dataset.licences import licence_code, non_commercial

HEAD = (
    "id,observed_on,time_observed_at,user_login,quality_grade,license,url,image_url,latitude,longitude,"
    "coordinates_obscured,geoprivacy,scientific_name\n"
)
ROW = (
    '501,2024-06-01,2024-06-01 15:30:00 UTC,"fern,ann",research,CC-BY-NC,https://inat.example/observations/501,'
    "https://static.example/photos/9001/medium.jpg,40.5,-79.9,false,,Ailanthus altissima\n"
)


def observation(number: int = 501, *photos: int, **fields) -> dict:
    shots = [
        {"id": photo, "license_code": "cc-by", "attribution": f"(c) Ann, {photo}", "url": "square.jpg"}
        for photo in photos
    ]
    return {
        "id": number, "photos": shots, "user": {"login": "ann", "name": "Ann"}, "location": "40.5,-79.9",
        "taxon": {"id": 57278, "name": "Ailanthus altissima"}, "quality_grade": "research",
        "time_observed_at": "2024-06-01T11:30:00-04:00", "obscured": False, **fields,
    }  # fmt: skip


def page(*observations: dict) -> bytes:
    return json.dumps({"total_results": len(observations), "results": observations}).encode()


def test_the_csv_tells_the_first_photo_with_the_licence_of_the_observation():
    (photo,) = read_observations(("\ufeff" + HEAD + ROW).encode(), "o.csv")
    assert (photo.photo_id, photo.observation_id) == ("9001", "501")
    assert (photo.licence, photo.own_licence) == ("cc-by-nc", False)
    assert photo.attribution == "(c) fern,ann, some rights reserved (CC-BY-NC)"
    assert (photo.latitude_deg, photo.longitude_deg, photo.obscured) == (40.5, -79.9, False)
    assert photo.taken_ns == 1717255800 * 10**9


def test_the_api_tells_every_photo_with_its_own_licence_and_the_same_time():
    photos = read_observations(page(observation(501, 9001, 9002)), "o.json")
    assert [photo.photo_id for photo in photos] == ["9001", "9002"]
    assert photos[1].attribution == "(c) Ann, 9002"
    assert all(photo.own_licence and photo.taken_ns == 1717255800 * 10**9 for photo in photos)
    assert read_observations(json.dumps([observation(501, 9001, 9002)]).encode(), "o.json") == photos


@pytest.mark.parametrize("fields", [{"obscured": True}, {"geoprivacy": "private"}, {"taxon_geoprivacy": "obscured"}])
def test_blurred_positions_are_marked(fields):
    assert read_observations(page(observation(1, 2, **fields)), "o.json")[0].obscured
    assert not read_observations(page(observation(1, 2, geoprivacy="open")), "o.json")[0].obscured


def test_nulls_and_missing_fields_are_no_error():
    bare = {"id": 1, "photos": [{"id": 2, "license_code": None}], "location": None, "time_observed_at": None}
    (photo,) = read_observations(page(bare), "o.json")
    assert photo.licence == ""
    assert photo.latitude_deg is None
    assert photo.taken_ns is None
    assert read_observations((HEAD + "7,,,,,,,,,,,,\n").encode(), "o.csv") == []


def test_what_several_files_say_counts_once_and_the_photos_own_licence_most():
    csv, api = read_observations((HEAD + ROW).encode(), "o.csv"), read_observations(page(observation(501, 9001)), "o")
    for order in (csv + api, api + csv, csv + api + csv):
        assert merged(order)["9001"].licence == "cc-by"


@pytest.mark.parametrize(
    ("document", "why"),
    [
        ("id,url\n1,x\n", "o.csv:1: no column license, image_url"),
        (HEAD + ROW + ROW.replace("501,2024", "x,2024"), "o.csv:3: id 'x'"),
        (HEAD + ROW.replace("40.5", "north"), "o.csv:2: 'north' is not a latitude"),
        ('{"error": "throttled"}', "not what the API answers"),
        ("[1]", "not what the API answers"),
    ],
)
def test_what_is_no_export_is_refused_with_its_line(document, why):
    with pytest.raises(DatasetError, match=why):
        read_observations(document.encode(), "o.csv")


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("9001.jpg", "9001"),
        ("9001/original.jpeg", "9001"),
        ("501_9002.jpg", "9002"),
        ("2024/9002 (1).jpg", "9002"),
        ("502.jpg", "9003"),
        ("501.jpg", None),  # two photos
        ("holiday.jpg", None),
        ("9001_9002.jpg", None),
        ("503.jpg", None),  # photo of one observation, number of another
        ("504_503.jpg", "503"),
    ],
)
def test_the_numbers_in_a_path_tell_which_photo_it_is(path, expected):
    pages = page(observation(501, 9001, 9002), observation(502, 9003), observation(503, 9004), observation(504, 503))
    photos = merged(read_observations(pages, "o"))
    found = photo_of(path, photos, observation_groups(photos.values()))
    assert (found.photo_id if found else None) == expected


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("CC-BY-NC", "cc-by-nc"), ("cc-by-nc-sa", "cc-by-nc-sa"), ("CC BY 4.0", "cc-by"), ("CC0", "cc0"),
        ("cc-by-nc-nd-4.0", "cc-by-nc-nd"), ("pd", "pd"), (None, ""), ("", ""), ("C", ""), ("all rights reserved", ""),
        ("cc-by-xx", ""), ("gfdl", ""),
    ],
)  # fmt: skip
def test_licences_are_read_and_what_is_not_known_is_reserved(text, code):
    assert licence_code(text) == code


def test_some_licences_forbid_commercial_use():
    assert [non_commercial(code) for code in ("cc-by-nc-sa", "cc-by", "cc0")] == [True, False, False]
