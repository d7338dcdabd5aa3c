import numpy as np
import pytest
from scipy import ndimage, signal

from pipeline.alignment.correlate import shift_sums, window
from pipeline.alignment.fields import crown_field, scaled, stem_density
from pipeline.alignment.grid import Grid
from pipeline.alignment.layers import independence
from pipeline.alignment.nmi_kernels import pose_information, pose_sums

RANDOM = np.random.default_rng(3)
POSES = np.column_stack([RANDOM.uniform(18, 30, 40), RANDOM.uniform(18, 30, 40), RANDOM.uniform(-0.6, 0.6, 40)])
XY = RANDOM.uniform(-14, 14, (500, 2))


def moved(pose):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return XY @ np.array([[c, -s], [s, c]]).T + pose[:2]


def entropy(counts):
    share = counts[counts > 0] / counts.sum()
    return -(share * np.log(share)).sum()


@pytest.fixture
def field():
    known = ndimage.binary_opening(RANDOM.uniform(size=(50, 46)) > 0.02, iterations=2)
    return scaled(ndimage.gaussian_filter(RANDOM.normal(size=known.shape), 2.0), known), known


def seen(xy, known):
    """All four nodes around are known."""
    low = np.floor(xy).astype(int)
    inside = np.all((low >= 0) & (low + 1 < known.shape), axis=1)
    low[~inside] = 0
    return inside & np.all([known[low[:, 0] + i, low[:, 1] + j] for i in (0, 1) for j in (0, 1)], axis=0)


def test_information_of_many_poses_is_that_of_histograms_one_by_one(field):
    values, known = field
    bins = 8
    levels = RANDOM.integers(0, bins, len(XY))
    found = pose_information(XY, levels, values, known, POSES, bins)
    for pose, (nmi, both, used) in zip(POSES, found, strict=True):
        xy = moved(pose)
        kept = seen(xy, known)
        at = ndimage.map_coordinates(values, xy[kept].T, order=1) * (bins - 1)
        low = np.minimum(at.astype(int), bins - 2)
        shares = np.concatenate([1 - (at - low), at - low])
        edges = np.arange(bins + 1)
        joint = np.histogram2d(
            np.tile(levels[kept], 2), np.concatenate([low, low + 1]), [edges, edges], weights=shares
        )[0]
        assert used == kept.sum()
        assert both == pytest.approx(entropy(joint.ravel()), abs=1e-9)
        assert nmi == pytest.approx((entropy(joint.sum(0)) + entropy(joint.sum(1))) / both, abs=1e-9)


def test_information_of_a_field_about_itself_is_two_and_about_chance_is_one():
    levels = np.indices((12, 12)).sum(axis=0) % 4
    xy = np.ascontiguousarray(np.argwhere(np.ones((12, 12))), float)
    known = np.ones((13, 13), np.bool_)
    values = np.zeros((13, 13))
    values[:12, :12] = levels / 3
    still = np.zeros((1, 3))
    assert pose_information(xy, levels.ravel(), values, known, still, 4)[0, 0] == pytest.approx(2.0)
    apart = np.repeat(np.arange(12) % 4, 12)  # independent of y, as the field below is of x
    values[:12, :12] = np.arange(12)[None, :] % 3 / 3
    assert pose_information(xy, apart, values, known, still, 4)[0, 0] == pytest.approx(1.0)


def test_sums_of_many_poses_are_those_of_interpolated_samples(field):
    values, known = field
    b = RANDOM.normal(size=len(XY))
    for pose, found in zip(POSES, pose_sums(XY, b, values, known, POSES), strict=True):
        kept = seen(moved(pose), known)
        a = ndimage.map_coordinates(values, moved(pose)[kept].T, order=1)
        c = b[kept]
        assert found == pytest.approx([kept.sum(), a.sum(), c.sum(), a @ a, c @ c, a @ c], abs=1e-9)


def test_masked_correlation_by_fft_is_that_of_direct_sums():
    reach = 5
    known, fixed = RANDOM.uniform(size=(40, 33)) > 0.2, RANDOM.normal(size=(40, 33))
    weight, values = np.zeros((40, 33)), RANDOM.normal(size=(40, 33))
    weight[8:30, 7:25] = RANDOM.uniform(size=(22, 18)) > 0.3
    at = window(fixed, known, Grid(np.zeros(2), 1.0, (40, 33)), reach)
    found = shift_sums(at, values, weight)
    pairs = [(1, 1), (fixed, 1), (1, values), (fixed**2, 1), (1, values**2), (fixed, values)]
    for column, (a, b) in enumerate(pairs):
        full = signal.correlate(a * known, b * weight, mode="full", method="direct")
        middle = full[39 - reach : 40 + reach, 32 - reach : 33 + reach]
        np.testing.assert_allclose(found[..., column], middle, atol=2e-3)


def test_independent_cells_of_smoothed_noise_are_as_many_as_in_closed_form():
    everywhere = np.ones((300, 300), np.bool_)
    noise = [RANDOM.normal(size=everywhere.shape) for _ in range(2)]
    assert independence((noise[0], everywhere), (noise[1], everywhere), 0.5) > 0.8
    sigma = 2.5  # its autocorrelation is exp(-l^2 / 4 sigma^2), the sum of whose squares is 2 pi sigma^2
    smooth = [ndimage.gaussian_filter(one, sigma, mode="wrap") for one in noise]
    found = independence((smooth[0], everywhere), (smooth[1], everywhere), 0.5)
    assert found == pytest.approx(1 / (2 * np.pi * sigma**2), rel=0.2)


def test_rows_count_for_fewer_independent_cells_than_scattered_trees():
    grid = Grid(np.zeros(2), 0.5, (160, 160))
    steps = np.arange(2.0, 78.0, 4.0)
    rows = np.column_stack([one.ravel() for one in np.meshgrid(steps, steps)])
    scattered = RANDOM.uniform(2, 78, rows.shape)
    everywhere = np.ones(grid.shape, np.bool_)
    shares = [
        independence((one, everywhere), (one, everywhere), 0.5)
        for one in (stem_density(xy, np.ones(len(xy)), grid, 1.0) for xy in (rows, scattered))
    ]
    assert shares[0] < 0.4 * shares[1]


@pytest.mark.parametrize(("lobe", "hollow"), [("positive", 0.0), ("absolute", 1.0)])
def test_a_crown_answers_as_in_closed_form_and_a_gap_only_to_the_absolute_lobe(lobe, hollow):
    cell, width, height, scale = 0.25, 2.0, 10.0, 1.5
    x, y = np.meshgrid(*[(np.arange(161) - 80) * cell] * 2, indexing="ij")
    crown = height * np.exp(-(x**2 + y**2) / (2 * width**2))
    expected = 2 * height * scale**2 * width**2 / (width**2 + scale**2) ** 2
    assert crown_field(crown, cell, [scale], lobe)[80, 80] == pytest.approx(expected, rel=0.01)
    assert crown_field(-crown, cell, [scale], lobe)[80, 80] == pytest.approx(hollow * expected, rel=0.01)


def test_the_stem_density_sums_to_the_weights_and_peaks_at_the_stem():
    grid = Grid(np.array([100.0, 50.0]), 0.5, (60, 40))
    stems, weights = np.array([[110.1, 60.3], [120.7, 58.2]]), np.array([1.0, 3.0])
    density = stem_density(stems, weights, grid, 1.0)
    assert density.sum() * 0.25 == pytest.approx(4.0, rel=1e-3)
    peak = grid.centres_m()[np.unravel_index(density.argmax(), grid.shape)]
    assert np.abs(peak - stems[1]).max() <= 0.25
