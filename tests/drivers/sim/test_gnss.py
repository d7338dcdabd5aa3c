import dataclasses
import math

import numpy as np
import pytest

from drivers.sim.gnss import ReceiverModel
from drivers.sim.gnss_errors import CLEAN, CORRUPTED, DISHONEST, HONEST, GnssErrorModel
from drivers.sim.gnss_geodesy import Datum, ecef, geodetic

SECOND = 10**9


class Straight:
    """1.2 m/s to the north-east under a canopy that closes and opens every minute."""

    def __init__(self, canopy=None):
        self._canopy = canopy

    def position(self, t_ns):
        return np.array([0.8, 0.9, 0.01]) * (t_ns / SECOND)

    def velocity(self, t_ns):
        return np.array([0.8, 0.9, 0.01])

    def canopy(self, t_ns):
        return 0.5 - 0.5 * math.cos(2 * math.pi * t_ns / SECOND / 60) if self._canopy is None else self._canopy


def sampled(source, seconds=600, step_ns=SECOND // 5):
    return [source.epoch(t_ns) for t_ns in range(0, seconds * SECOND, step_ns)]


def errors(source, epochs, step_ns=SECOND // 5):
    """(n, 3) ENU error of each epoch with a fix, by way back through the datum; and its reported sigmas."""
    rows, sigmas = [], []
    for k, epoch in enumerate(epochs):
        if epoch.quality:
            enu = source.datum.enu(epoch.latitude_deg, epoch.longitude_deg, epoch.height_m)
            rows.append(np.array(enu) - Straight().position(k * step_ns))
            sigmas.append(epoch.sigma_enu_m)
    return np.array(rows), np.array(sigmas)


@pytest.mark.parametrize("point", [(49.0, 8.4, 165.0), (-33.9, 151.2, -20.0), (89.9, -170.0, 500.0), (0.0, 0.0, 0.0)])
def test_geodetic_and_earth_centred_coordinates_are_inverse(point):
    assert geodetic(ecef(*point)) == pytest.approx(point, abs=1e-9)


def test_earth_centred_coordinates_of_known_points():
    assert ecef(0.0, 0.0, 0.0) == pytest.approx((6378137.0, 0.0, 0.0))
    assert ecef(90.0, 0.0, 0.0) == pytest.approx((0.0, 0.0, 6356752.314245), abs=1e-6)
    assert ecef(0.0, 90.0, 100.0) == pytest.approx((0.0, 6378237.0, 0.0), abs=1e-6)


def test_a_metre_is_a_metre():
    """Oracle: the radii of curvature of the ellipsoid in closed form."""
    datum = Datum(49.0136, 8.4044, 165.0)
    e2 = 0.00669437999014
    w = math.sqrt(1 - e2 * math.sin(math.radians(49.0136)) ** 2)
    meridian, normal = 6378137.0 * (1 - e2) / w**3, 6378137.0 / w
    latitude, longitude, height = datum.geodetic((1.0, 0.0, 0.0))
    assert math.radians(longitude - 8.4044) * (normal + 165) * math.cos(math.radians(49.0136)) == pytest.approx(
        1, abs=1e-6
    )
    latitude, longitude, height = datum.geodetic((0.0, 1.0, 2.0))
    assert math.radians(latitude - 49.0136) * (meridian + 165) == pytest.approx(1, abs=1e-5)
    assert height == pytest.approx(167.0, abs=1e-6)
    assert datum.enu(*datum.geodetic((300.0, -700.0, 12.0))) == pytest.approx((300.0, -700.0, 12.0), abs=1e-6)


def test_the_same_seed_gives_the_same_whoever_asks_when():
    a, b, other = (
        ReceiverModel(Straight(), CORRUPTED),
        ReceiverModel(Straight(), CORRUPTED),
        ReceiverModel(Straight(), dataclasses.replace(CORRUPTED, seed=2)),
    )
    times = [k * SECOND // 5 for k in range(500)]
    forwards = [repr(a.epoch(t)) for t in times]
    assert [repr(b.epoch(t)) for t in reversed(times)] == forwards[::-1]
    assert [repr(other.epoch(t)) for t in times] != forwards


def test_a_clean_sky_is_rtk_fixed_throughout():
    source = ReceiverModel(Straight(), CLEAN)
    epochs = sampled(source, 120)
    assert {epoch.quality for epoch in epochs} == {4}
    found, sigmas = errors(source, epochs)
    assert np.abs(found).max() < 0.1
    assert sigmas.max() < 0.05


def test_canopy_drives_the_quality():
    def share(canopy, quality):
        epochs = sampled(ReceiverModel(Straight(canopy), GnssErrorModel()), 300)
        return np.mean([epoch.quality == quality for epoch in epochs])

    assert share(0.05, 4) > 0.95
    assert share(0.75, 5) > 0.6
    assert share(0.98, 1) > 0.6
    assert {epoch.quality for epoch in sampled(ReceiverModel(Straight(), GnssErrorModel()))} == {1, 4, 5}


@pytest.mark.parametrize(("model", "low", "high"), [(HONEST, 0.7, 1.3), (DISHONEST, 3.5, 6.5)])
def test_sigmas_tell_the_truth_or_a_fifth_of_it(model, low, high):
    ratios = []
    for seed in range(3):
        source = ReceiverModel(Straight(), dataclasses.replace(model, seed=seed))
        found, sigmas = errors(source, sampled(source))
        ratios.append(found / sigmas)
    rms = math.sqrt(float(np.mean(np.concatenate(ratios) ** 2)))
    assert low < rms < high


def test_errors_are_correlated_in_time():
    """Oracle: the autocorrelation of a Gauss-Markov process, exp(-lag / time constant)."""
    source = ReceiverModel(Straight(0.6), dataclasses.replace(CLEAN, white_share=0.0))
    east = np.array([source.error_m(k * SECOND)[0] for k in range(2400)])
    near, far = (np.corrcoef(east[:-lag], east[lag:])[0, 1] for lag in (2, 120))
    assert near == pytest.approx(math.exp(-2 / 20), abs=0.05)
    assert abs(far) < 0.35


def test_each_corruption_has_its_size_and_length():
    quiet = GnssErrorModel(sigma_fixed_m=(0, 0), sigma_float_m=(0, 0), sigma_single_m=(0, 0))
    offsets = ReceiverModel(Straight(0.1), dataclasses.replace(quiet, offsets_per_min=1.0))
    sizes = np.array([np.linalg.norm(offsets.error_m(k * SECOND // 5)) for k in range(3000)])
    assert set(np.unique(sizes > 0.1)) == {False, True}
    assert 6 < sizes[sizes > 0.1].mean() < 14
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], sizes > 0.1, [0]]))))[::2]
    assert np.median(runs) / 5 == pytest.approx(10, abs=0.3)
    spikes = ReceiverModel(Straight(0.1), dataclasses.replace(quiet, spikes_per_min=6.0))
    sizes = np.array([np.linalg.norm(spikes.error_m(k * SECOND // 5)) for k in range(3000)])
    assert 20 < (sizes > 1).sum() < 150
    assert 6 < sizes[sizes > 1].mean() < 14


def test_dropouts_last_15_to_30_s():
    source = ReceiverModel(Straight(0.1), dataclasses.replace(GnssErrorModel(), dropouts_per_min=1.0))
    lost = np.array([epoch.quality == 0 for epoch in sampled(source, 900)])
    edges = np.flatnonzero(np.diff(lost.astype(int)))
    runs_s = (edges[1::2] - edges[::2][: len(edges[1::2])]) / 5
    assert len(runs_s) > 4
    assert runs_s.min() >= 14.8
    assert runs_s.max() <= 30.2
    no_fix = next(epoch for epoch in sampled(source, 900) if epoch.quality == 0)
    assert math.isnan(no_fix.latitude_deg)
