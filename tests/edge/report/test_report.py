"""The page says what is there, what is not, and what to do; and it needs nothing but itself."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import msgspec
import numpy as np
import pytest

from edge.cli.main import main
from edge.config import Config
from edge.errors import FormatError
from edge.process.process import Task
from edge.recording.account import SessionAbout, Verdict
from edge.recording.disk import Disk
from edge.recording.folder import SessionRecord, write_session
from edge.recording.summary import MarkNote
from edge.report.advice import advise
from edge.report.location import drift
from edge.report.made import read_made
from edge.report.report import write_report
from pipeline.evaluation.trajectory import Trajectory
from tests.edge import sessions
from tests.edge.process.handed import found, hand_out
from tests.edge.recordings import START_NS

VOID = {"meta", "img", "path", "rect", "line", "use", "image"}


class Page(HTMLParser):
    """Text and attributes; tags have to be closed in turn."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict]] = []
        self.text = ""
        self.feed(html)
        assert self.open == ["html"] or not self.open

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data

    def all(self, tag):
        return [attrs for name, attrs in self.seen if name == tag]


def page(path) -> Page:
    html = path.read_text(encoding="utf-8")
    assert "<script" not in html
    assert not re.search(r"(src|href)=\"(?!data:|#|geo:)", html)  # nothing from anywhere else
    assert "http" not in re.sub(r"data:[^\"]+", "", html)
    return Page(html)


def test_trees_have_their_picture_place_and_distance(recording, tmp_path):
    folder, _ = hand_out(recording, found(tmp_path / "given"))
    read = page(write_report(Task([recording], folder), Config()))
    assert [tag["alt"] for tag in read.all("img")] == ["tree 1", "tree 7"]
    assert len([a for a in read.all("a") if a["href"].startswith("geo:")]) == 3
    assert "2: Ailanthus altissima, 93%" in read.text
    assert "nobody has verified" in read.text
    assert [tag["id"] for tag in read.all("image")] == ["relief"]
    assert {tag["href"] for tag in read.all("use")} == {"#relief"}
    titles = ("What to do", "From above", "Trees", "Sensors", "GNSS", "Where it was, and how well that is known")
    assert [title for title in titles if title in read.text] == list(titles)
    assert "The recording has no diagnostics" in read.text


def test_what_is_not_there_is_said(recording, tmp_path):
    read = page(write_report(Task([recording], tmp_path / "none"), Config(), tmp_path / "r.html"))
    assert "has not been processed" in read.text
    assert "Run `mapforest process`" in read.text
    assert "No detector looked" in read.text
    assert "From above" not in read.text


def test_a_local_session_is_drawn_where_it_is_and_says_so(recording, tmp_path):
    folder, _ = hand_out(recording, found(tmp_path / "given", "odom"), gnss=False)
    read = page(write_report(Task([recording], folder), Config()))
    assert "no place on the Earth" in read.text
    assert "x 5.0 m, y 3.0 m" in read.text
    assert not [a for a in read.all("a") if a["href"].startswith("geo:")]


def session(folder, verdict="WARN", **changes):
    folder.mkdir()
    sessions.write_session(folder / f"{folder.name}_0.mcap", session={}, **changes)
    about = SessionAbout(mission="slope", operator="A. Walker", carrier="backpack")
    record = SessionRecord(
        session=folder.name,
        state="finished",
        about=about,
        started_utc="",
        anchor_utc_ns=START_NS,
        anchor_monotonic_ns=0,
        marks=(MarkNote(START_NS + 7 * 10**9, "seedlings <left>"),),
        verdict=Verdict(verdict, ("Something.",)),
    )
    write_session(Disk(), folder, record)
    return folder


def test_the_verdict_of_the_field_stands_at_the_top_with_what_to_do(tmp_path):
    gone = session(tmp_path / "walk", changes={"imu": {"silent": ((4.0, 12.0),)}})
    read = page(write_report(Task([gone]), Config()))
    assert [tag["class"] for tag in read.all("div") if "class" in tag] == ["verdict warn"]
    assert "A. Walker" in read.text
    assert "Judged again now, it is FAIL" in read.text
    assert re.search(r"/livox/imu.*Check its power and its Ethernet cable", read.text)
    assert "7 sseedlings <left>" in read.text
    assert (gone / "products" / "report.html").exists()


def test_a_rate_that_fell_is_seen_in_its_curve(tmp_path):
    gone = session(tmp_path / "walk", changes={"lidar": {"silent": ((5.0, 10.0),)}})
    html = write_report(Task([gone]), Config()).read_text()
    curve = re.search(r"/livox/lidar, messages a second.*?class=\"line a\" d=\"M([^\"]+)\"", html, re.DOTALL).group(1)
    heights = [float(pair.split()[1]) for pair in curve.split("L")]
    assert max(heights) - min(heights) > 60  # pixels: from ten a second to none


def test_advice_is_given_where_something_is_wrong_and_not_elsewhere(recording, tmp_path):
    folder, _ = hand_out(recording, found(tmp_path / "given"))
    made = read_made(folder)
    said = " ".join(one.text for one in advise(made))
    assert "3 of 3 trees are unverified" in said
    assert "Only 0% of the fixes had RTK" in said
    assert "known to" not in said
    worse = replace(
        made,
        placed=None,
        facts=msgspec.structs.replace(
            made.facts,
            estimates=5,
            degenerate=4,
            findings=msgspec.structs.replace(made.facts.findings, demonstration=True),
        ),
        trees=[{**tree, "n_hits": 1} for tree in made.trees],
    )
    told = advise(worse)
    assert all(one.advice for one in told)
    words = " ".join(one.text for one in told)
    for part in ("gave no pose", "alone could not tell", "no place on the Earth", "simulated images", "1, 2, 7"):
        assert part in words


def test_drift_is_what_is_left_when_the_starts_are_laid_together():
    stamps, count = np.arange(50) * 10**8, 50
    way = np.column_stack([np.linspace(0, 10, count), np.zeros(count), np.zeros(count)])
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    odom = Trajectory(stamps, way, np.repeat(np.eye(3)[None], count, axis=0))
    bent = way @ turned.T + [5.0, 6.0, 7.0] + np.linspace(0, 1, count)[:, None] * [0.3, 0.4, -0.2]
    across, up = drift(odom, Trajectory(stamps, bent, np.repeat(turned[None], count, axis=0)))
    np.testing.assert_allclose(across, np.linspace(0, 0.5, count), atol=1e-9)
    np.testing.assert_allclose(up, np.linspace(0, 0.2, count), atol=1e-9)


def test_products_of_another_version_are_an_error_that_says_what_to_do(recording, tmp_path):
    folder, _ = hand_out(recording, found(tmp_path / "given"))
    (folder / "covariance.csv").write_text("something else\n")
    with pytest.raises(FormatError, match="process"):
        write_report(Task([recording], folder), Config())


def test_the_command_says_where_the_page_is(recording, tmp_path, capsys):
    assert main(["report", str(recording), "--output", str(tmp_path / "a" / "r.html"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["report"] == str(tmp_path / "a" / "r.html")
    assert main(["report", str(tmp_path / "nothing.mcap")]) == 1
    assert main(["report", str(recording), "--output", "/proc/none/r.html"]) == 1
    assert "give another place with --output" in capsys.readouterr().err
