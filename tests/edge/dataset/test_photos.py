"""Photos of iNaturalist come in with licence and attribution; what may not be used, or is there already, does not."""

from __future__ import annotations

import json

import cv2
import pytest

from edge.cli import exit_codes
from edge.cli.main import main
from edge.dataset.folder import DatasetFolder
from edge.dataset.photos import PhotoRules, take_photos
from edge.errors import FormatError
from tests.edge.dataset import scenes


def observation(number: int, photos: dict[int, str | None], **fields) -> dict:
    """photos: number -> licence."""
    shots = [{"id": k, "license_code": code, "attribution": f"(c) Ann {k}"} for k, code in photos.items()]
    told = {"id": number, "photos": shots, "user": {"login": "ann"}, "location": "40.5,-79.9"}
    told |= {"taxon": {"name": "Ailanthus altissima"}, "uri": f"https://inat.example/{number}"}
    return told | {"quality_grade": "research"} | fields


def write(folder, photos: dict[str, bytes], *observations: dict):
    for name, data in photos.items():
        (folder / "photos" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "photos" / name).write_bytes(data)
    (folder / "o.json").write_text(json.dumps({"results": list(observations)}))
    return folder / "photos", [folder / "o.json"]


def take(folder, given, **rules):
    made = DatasetFolder.make(folder)
    return take_photos(*given, made, PhotoRules(**rules), lambda share: None), DatasetFolder.open(folder)


def test_photos_keep_licence_attribution_place_and_observation(tmp_path):
    given = write(
        tmp_path,
        {"9001.png": scenes.png(1), "501_9002.PNG": scenes.png(2), "9003/original.png": scenes.png(3)},
        observation(501, {9001: "cc-by", 9002: "cc-by-nc"}, time_observed_at="2024-06-01T12:00:00Z"),
        observation(502, {9003: "cc0"}, obscured=True),
    )
    report, made = take(tmp_path / "trees", given)
    by_name = {record.image: record for record in made.records}
    assert set(by_name) == {"inaturalist_501_9001.png", "inaturalist_501_9002.png", "inaturalist_502_9003.png"}
    first = by_name["inaturalist_501_9001.png"]
    assert (first.source, first.group, first.licence) == ("inaturalist", "inaturalist 501", "cc-by")
    assert (first.attribution, first.url) == ("(c) Ann 9001", "https://inat.example/501")
    assert first.taxon == "Ailanthus altissima"
    assert (first.latitude_deg, first.longitude_deg, first.stamp_ns) == (40.5, -79.9, 1717243200 * 10**9)
    assert made.image_path(first).read_bytes() == scenes.png(1)
    assert [by_name[name].non_commercial for name in sorted(by_name)] == [False, True, False]
    assert by_name["inaturalist_502_9003.png"].obscured
    assert (report.added, report.observations, report.non_commercial, report.obscured) == (3, 2, 1, 1)


def test_reserved_photos_and_other_grades_stay_out_and_nc_does_on_request(tmp_path):
    given = write(
        tmp_path,
        {f"{k}.png": scenes.png(k) for k in (9001, 9002, 9003, 9004)},
        observation(501, {9001: None, 9002: "cc-by-nc-sa"}),
        observation(502, {9003: "cc-by"}, quality_grade="needs_id"),
        observation(503, {9004: "cc-by", 9005: "cc-by"}),
    )
    report, made = take(tmp_path / "a", given)
    assert (report.reserved, report.other_grade, report.non_commercial, report.observations) == (1, 1, 1, 2)
    assert {record.image for record in made.records} == {"inaturalist_501_9002.png", "inaturalist_503_9004.png"}
    assert report.without_file == 1
    report, made = take(tmp_path / "b", given, without_nc=True, any_grade=True)
    assert sorted(record.licence for record in made.records) == ["cc-by", "cc-by"]
    assert report.non_commercial == 1


def test_the_same_picture_comes_in_once_the_larger_of_two(tmp_path):
    large = scenes.picture(1, (192, 128))
    small = cv2.resize(large, (96, 64), interpolation=cv2.INTER_AREA)
    small, large = (cv2.imencode(".png", one)[1].tobytes() for one in (small, large))
    given = write(
        tmp_path,
        {"9001.png": small, "9002.png": large, "9003.png": scenes.png(5), "9004.png": scenes.png(5)},
        observation(501, {9001: "cc-by"}),
        observation(502, {9002: "cc-by"}),
        observation(503, {9003: "cc-by", 9004: "cc-by"}),
    )
    report, made = take(tmp_path / "trees", given)
    assert sorted(record.image for record in made.records) == ["inaturalist_502_9002.png", "inaturalist_503_9003.png"]
    assert (report.alike, report.already) == (1, 1)
    again, made = take(tmp_path / "trees", given)
    assert (again.added, len(made.records)) == (0, 2)


def test_an_observation_gives_no_more_photos_than_asked(tmp_path):
    photos = {f"{k}.png": scenes.png(k) for k in range(9001, 9006)}
    given = write(tmp_path, photos, observation(501, dict.fromkeys(range(9001, 9006), "cc-by")))
    report, made = take(tmp_path / "trees", given, most=2)
    assert (report.added, report.too_many, len(made.records)) == (2, 3, 2)


def test_files_that_are_no_photo_or_broken_are_named(tmp_path, capsys):
    given = write(
        tmp_path,
        {"9001.jpg": b"not an image", "holiday.png": scenes.png(1), "9002.png": scenes.png(2), "notes.txt": b""},
        observation(501, {9001: "cc-by", 9002: "cc-by"}),
    )
    command = ["dataset", "inaturalist", str(given[0]), "--observations", str(given[1][0])]
    assert main([*command, "--output", str(tmp_path / "trees")]) == exit_codes.WARNINGS
    told = capsys.readouterr().out
    assert "1 of 3 photos added" in told
    assert "holiday.png" in told
    assert "9001.jpg: not an image" in told


def test_the_csv_of_the_export_site_does_too_and_that_its_licence_is_the_observations_is_said(tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "501.png").write_bytes(scenes.png(1))
    (tmp_path / "o.csv").write_text(
        "id,license,image_url,user_login\n501,CC-BY,https://static.example/photos/9001/medium.jpg,ann\n"
    )
    report, made = take(tmp_path / "trees", (tmp_path / "photos", [tmp_path / "o.csv"]))
    assert report.licence_of_observation == 1
    assert made.records[0].attribution == "(c) ann, some rights reserved (CC-BY)"


def test_no_photos_and_no_observations_are_errors(tmp_path):
    photos, observations = write(tmp_path, {"9001.png": scenes.png(1)}, observation(501, {9001: "cc-by"}))
    (tmp_path / "empty").mkdir()
    with pytest.raises(FormatError, match="no images in it"):
        take(tmp_path / "trees", (tmp_path / "empty", observations))
    with pytest.raises(FormatError, match=r"missing.csv: cannot be read"):
        take(tmp_path / "trees", (photos, [tmp_path / "missing.csv"]))
    (tmp_path / "bad.csv").write_text("a,b\n1,2\n")
    with pytest.raises(FormatError, match=r"bad.csv:1: no column"):
        take(tmp_path / "trees", (photos, [tmp_path / "bad.csv"]))
