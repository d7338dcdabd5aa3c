"""What was found as a table: identities that last, places on the Earth, and honest words."""

from __future__ import annotations

import uuid
from dataclasses import replace

import numpy as np
import pytest

from drivers.messages import FixQuality, GnssFix
from pipeline.gnss.geodesy import Datum
from pipeline.products.findings import Model
from pipeline.products.geoid import constant_geoid, receiver_geoid
from pipeline.products.occurrences import DEMONSTRATION, occurrences, species
from tests.pipeline.products.stand import DATUM, SITE, findings, survey, tree


def test_a_tree_is_where_the_closed_form_puts_it():
    rows = occurrences(findings(), survey())
    oracle = Datum(*DATUM)
    for k, one in enumerate(findings().trees):
        latitude, longitude, height = oracle.geodetic(one.position_m)
        assert (rows["latitude"][k], rows["longitude"][k]) == pytest.approx((latitude, longitude), abs=1e-8)
        assert rows["ellipsoidal_height_m"][k] == pytest.approx(height, abs=0.01)
        assert rows["elevation_m"][k] == pytest.approx(height + 33.5, abs=0.01)
        np.testing.assert_allclose(
            [rows["easting"][k], rows["northing"][k]], SITE.utm(one.position_m[None])[0, :2], atol=1e-3
        )
    assert rows["epsg"].tolist() == [32618] * 3


def test_the_uncertainty_is_the_radius_that_holds_19_of_20():
    rows = occurrences(findings(), survey())
    drawn = np.random.default_rng(5).normal(0, rows["sigma_m"][0], (200_000, 2))
    inside = np.mean(np.linalg.norm(drawn, axis=1) < rows["coordinate_uncertainty_m"][0])
    assert inside == pytest.approx(0.95, abs=0.005)


def test_the_same_tree_keeps_its_uuid_and_another_has_another():
    first, again = (occurrences(findings(), survey())["uuid"].tolist() for _ in range(2))
    assert first == again
    assert len({uuid.UUID(text) for text in first}) == 3
    later = replace(findings(), trees=[tree(1, 5.0, 3.0, first_ns=1)])
    assert occurrences(later, survey())["uuid"][0] != first[0]


def test_distances_are_from_the_way_and_along_it():
    rows = occurrences(findings(), survey())
    np.testing.assert_allclose(rows["from_track_m"], [3.0, 4.0, 20.0])
    np.testing.assert_allclose(rows["along_track_m"], [5.0, 9.0, 40.0])


def test_what_is_not_known_is_empty_and_what_is_doubtful_is_said():
    rows = occurrences(findings(), survey())
    assert np.isnan(rows["height_m"][2])
    assert np.isnan(rows["infested_area_m2"][2])
    assert rows["infested_area_m2"][0] == pytest.approx(np.pi * 4, abs=0.05)
    assert rows["comments"].tolist() == ["", "", "stem not seen: the position is below the middle of the crown"]
    assert set(rows["verification_status"]) == {"unverified"}
    shown = replace(findings(), model=Model("demo", "", demonstration=True))
    assert all(DEMONSTRATION in said for said in occurrences(shown, survey())["comments"])


def test_local_coordinates_pretend_nothing():
    rows = occurrences(findings(), survey(None))
    assert not {"latitude", "longitude", "easting", "epsg", "elevation_m"} & rows.keys()
    assert (rows["x_m"][1], rows["y_m"][1], rows["z_m"][1]) == (9.0, 4.0, -1.5)
    assert rows["georef_protocol"][0].startswith("none")


def test_no_tree_gives_the_same_columns():
    empty = occurrences(replace(findings(), trees=()), survey())
    full = occurrences(findings(), survey())
    assert [(name, len(column)) for name, column in empty.items()] == [(name, 0) for name in full]
    assert {name: column.dtype for name, column in empty.items()} == {n: c.dtype for n, c in full.items()}


@pytest.mark.parametrize("name", ["tree-of-heaven", "Tree_of_Heaven", "ailanthus", "Ailanthus altissima"])
def test_names_of_the_tree(name):
    assert species(name) == ("Ailanthus altissima", "tree-of-heaven")


def test_a_class_of_another_model_keeps_its_name():
    assert species("staghorn sumac") == ("", "staghorn sumac")


def fix(separation_m: float) -> GnssFix:
    told = (
        1,
        1,
        0,
        True,
        FixQuality.RTK_FIXED,
        40.0,
        -75.0,
        60.0,
        separation_m,
        20,
        0.6,
        None,
        (0.01, 0.01, 0.02),
        "gst",
    )
    return GnssFix(*told)


def test_the_receivers_geoid_is_the_median_and_zero_is_none():
    assert receiver_geoid([fix(-33.5), fix(-33.4), fix(float("nan")), fix(-33.6)]).undulation_m == -33.5
    unknown = receiver_geoid([fix(0.0), fix(float("nan"))])
    assert not unknown.known
    assert "unknown" in unknown.words
    assert "-33.50 m" in constant_geoid(-33.5).words
