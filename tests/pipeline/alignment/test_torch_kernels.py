import sys

import numpy as np
import pytest
from scipy import ndimage

from pipeline.alignment.errors import DeviceError
from pipeline.alignment.fields import scaled
from pipeline.alignment.torch_kernels import by_torch, kernels_on


@pytest.fixture
def given():
    """A field with holes, and poses of which some lie partly or wholly beside it."""
    random = np.random.default_rng(5)
    known = ndimage.binary_opening(random.uniform(size=(50, 46)) > 0.02, iterations=2)
    field = scaled(ndimage.gaussian_filter(random.normal(size=known.shape), 2.0), known)
    poses = np.column_stack([*random.uniform(-10, 60, (2, 300)), random.uniform(-3, 3, 300)])
    poses[-1] = 900.0
    return random.uniform(-14, 14, (400, 2)), random.normal(size=400), field, known, poses


def test_pytorch_gives_the_scores_of_the_compiled_kernels(given, monkeypatch):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    monkeypatch.setattr("pipeline.alignment.torch_kernels.AT_ONCE", 20_000)
    xy, values, field, known, poses = given
    levels = np.digitize(values, np.linspace(-2, 2, 15))
    theirs, ours = by_torch(torch, "cpu"), kernels_on("cpu")
    expected = ours.information(xy, levels, field, known, poses, 16)
    np.testing.assert_allclose(theirs.information(xy, levels, field, known, poses, 16), expected, atol=1e-5)
    assert expected[-1].tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(theirs.sums(*given), ours.sums(*given), atol=1e-4)


def test_a_gpu_without_pytorch_is_refused_with_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(DeviceError, match=r"--device cuda: needs PyTorch.*leave --device out"):
        kernels_on("cuda")
