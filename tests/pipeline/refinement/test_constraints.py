"""What an analyst writes is read, and what cannot be meant is refused with the reason."""

from __future__ import annotations

import pytest

from pipeline.refinement.constraints import Constraints, Guess, Pair, Pin, Stretch, check, read_constraints
from pipeline.refinement.errors import ConstraintsRefused

TEXT = """
[[accept]]
a_s = 12.0
b_s = 240.0
[[closure]]
a_s = 1.0
b_s = 300.5
yaw_deg = 180.0
[[drop_gnss]]
from_s = 3
to_s = 9
[[pin]]
at_s = 5.0
latitude_deg = 47.0
longitude_deg = 8.0
height_m = 500.0
"""


def test_a_file_is_read(tmp_path):
    path = tmp_path / "constraints.toml"
    path.write_text(TEXT)
    assert read_constraints(path) == Constraints(
        accept=(Pair(12.0, 240.0),),
        closure=(Guess(1.0, 300.5, yaw_deg=180.0),),
        drop_gnss=(Stretch(3, 9),),
        pin=(Pin(5.0, 47.0, 8.0, 500.0),),
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[forbid]]\na_s = 1.0\n", "missing required field `b_s`"),
        ("[[forbit]]\na_s = 1.0\n", "unknown field `forbit`"),
        ("[[forbid]", "docs/refinement.md"),
    ],
)
def test_a_wrong_file_is_refused_by_name(tmp_path, text, said):
    path = tmp_path / "constraints.toml"
    path.write_text(text)
    with pytest.raises(ConstraintsRefused, match=said):
        read_constraints(path)


@pytest.mark.parametrize(
    ("constraints", "said"),
    [
        (Constraints(drop_gnss=(Stretch(5.0, 700.0),)), "the session lasts from 0 to 600.0 s"),
        (Constraints(drop_gnss=(Stretch(5.0, 5.0),)), "ends before it begins"),
        (Constraints(accept=(Pair(1.0, 90.0),), forbid=(Pair(1.0, 90.0),)), "accepted and forbidden"),
        (Constraints(pin=(Pin(5.0, 47.0, 8.0, 500.0), Pin(5.2, 47.0001, 8.0, 500.0))), "11.1. m apart"),
    ],
)
def test_contradictions_are_named(constraints, said):
    with pytest.raises(ConstraintsRefused, match=said):
        check(constraints, {"": 600.0})
