"""The page of a comparison holds what there is to say of each trajectory, and needs nothing from elsewhere."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np

from pipeline.evaluation.pair import Pair
from pipeline.evaluation.trajectory import Trajectory
from pipeline.products.comparison import write_comparison
from pipeline.products.plots import NARROW, Line, Plot

COUNT = 800


def walk() -> Trajectory:
    angles = np.linspace(0, 2 * np.pi, COUNT)
    positions = np.column_stack([5 * np.cos(angles), 5 * np.sin(angles), 0 * angles])
    return Trajectory(np.arange(COUNT) * 10**8, positions, np.tile(np.eye(3), (COUNT, 1, 1)))


def pairs() -> list[Pair]:
    off = walk().positions_m + np.random.default_rng(1).normal(0, 0.1, (COUNT, 3))
    stated = replace(walk(), positions_m=off, covariance=np.tile(0.01 * np.eye(3), (COUNT, 1, 1)))
    return [
        Pair("map <1> & more", stated, walk()),
        Pair("odom", replace(stated, covariance=None), walk(), ("yaw",)),
        Pair("live - offline", stated, walk(), ("none",), against="offline trajectory"),
    ]


def test_each_trajectory_has_its_section_and_its_figures(tmp_path):
    write_comparison(tmp_path / "page.html", "Trajectories of a walk", pairs())
    text = (tmp_path / "page.html").read_text()
    sections = text.split("<h2>")[1:]
    assert [one.partition("</h2>")[0] for one in sections] == ["map &lt;1&gt; &amp; more", "odom", "live - offline"]
    titles = [re.findall("<h3>([^,(<]+)", one) for one in sections]
    common = ["Both ways from above", "Horizontal error", "Vertical error", "Relative error over stretches of the way "]
    assert titles[1] == common
    for full in (titles[0], titles[2]):
        assert [title.partition(" and 3 sigmas")[0] for title in full[:4]] == common
        assert [title.split()[0] for title in full[4:]] == ["Normalised", "Share"]
    assert ">5 m<" in sections[0]
    assert ">50 m<" not in sections[0]
    assert "95 % between 0.07 and 3.12" in sections[0]
    assert ">offline trajectory<" in sections[2]


def test_it_is_well_formed_and_asks_for_nothing(tmp_path):
    write_comparison(tmp_path / "page.html", "Walk", pairs())
    text = (tmp_path / "page.html").read_text()
    assert not re.search("https?:|src=|href=|@import|<script|url\\(|nan", text)
    drawn = re.findall("<svg.*?</svg>", text, re.DOTALL)
    assert len(drawn) == 2 * (6 + 4 + 6)
    for svg in drawn:
        ElementTree.fromstring(svg)


def test_a_narrow_plot_has_its_legend_and_names_within_its_width():
    at = np.arange(3.0)
    lines = [Line(at, at, f"a line with a long name {k}") for k in range(3)]
    plot = Plot("x", "y", lines, x_names=["5 m", "10 & m", "20 m"])
    wide, narrow = (ElementTree.fromstring(plot.svg(width)) for width in (960, NARROW))
    rows = [{text.get("y") for text in svg.iter("text") if "long name" in (text.text or "")} for svg in (wide, narrow)]
    assert [len(one) for one in rows] == [1, 3]
    texts = [text.text for text in narrow.iter("text")]
    assert {"5 m", "10 & m", "20 m"} <= set(texts)
    assert all(0 < float(text.get("x")) < NARROW for text in narrow.iter("text"))
    assert narrow.get("viewBox") == f"0 0 {NARROW} {200 + 3 * 18}"
