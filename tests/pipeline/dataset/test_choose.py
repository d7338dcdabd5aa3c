"""Of each stretch the sharpest, nothing twice; sharpness and hashes as closed forms and other libraries have them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.fft import dctn
from scipy.ndimage import laplace

from pipeline.dataset.choose import Candidate, Tally, choose
from pipeline.dataset.hashes import near_pairs, perceptual_hash
from pipeline.dataset.sharpness import LONGEST_PX, sharpness


def scene(seed: int, blur: float = 0.0) -> np.ndarray:
    """A grey picture with structure at all scales."""
    rng = np.random.default_rng(seed)
    image = sum(cv2.resize(rng.random((n, n)), (160, 120), interpolation=cv2.INTER_CUBIC) for n in (4, 8, 16, 64))
    image = cv2.normalize(image, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    return cv2.GaussianBlur(image, (0, 0), blur) if blur else image


def bits_apart(one: str, other: str) -> int:
    return bin(int(one, 16) ^ int(other, 16)).count("1")


def colour(grey: np.ndarray) -> np.ndarray:
    return cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)


def test_sharpness_is_the_variance_of_the_laplacian():
    image = scene(1)
    assert sharpness(image) == pytest.approx(laplace(image.astype(float), mode="mirror").var(), rel=1e-4)


def test_blur_lowers_sharpness_and_the_size_of_a_photo_does_not_matter():
    image = scene(2)
    values = [sharpness(scene(2, blur)) for blur in (0.0, 0.7, 1.5, 3.0)]
    assert values == sorted(values, reverse=True)
    fit = cv2.resize(image, (LONGEST_PX, LONGEST_PX * 3 // 4), interpolation=cv2.INTER_CUBIC)
    large = cv2.resize(fit, None, fx=3, fy=3, interpolation=cv2.INTER_CUBIC)
    assert sharpness(large) == pytest.approx(sharpness(fit), rel=0.2)


def test_the_hash_is_the_sign_of_low_cosine_terms_and_survives_compression_and_size():
    image = scene(3)
    small = cv2.resize(image, (32, 32), interpolation=cv2.INTER_AREA).astype(float)
    low = dctn(small, norm="ortho")[:8, :8].ravel()
    expected = np.packbits(low > np.median(low[1:])).tobytes().hex()
    assert perceptual_hash(image) == expected
    again = cv2.imdecode(cv2.imencode(".jpg", cv2.resize(image, (400, 300)), [cv2.IMWRITE_JPEG_QUALITY, 70])[1], 0)
    assert bits_apart(perceptual_hash(again), expected) <= 4
    assert bits_apart(perceptual_hash(scene(4)), expected) > 10


def test_near_pairs_are_those_that_comparing_all_finds():
    rng = np.random.default_rng(5)
    words = rng.integers(0, 2**63, 40).tolist()
    words += [word ^ (1 << int(bit)) for word, bit in zip(words[:10], rng.integers(0, 63, 10), strict=True)]
    hashes = [f"{word:016x}" for word in words] + [""]
    expected = {
        (i, j) for i in range(50) for j in range(i + 1, 50) if bin(int(words[i]) ^ int(words[j])).count("1") <= 4
    }
    assert set(near_pairs(hashes)) == expected
    assert len(expected) >= 10
    assert list(near_pairs(["", ""])) == []


def walk(alongs, sharp=()):
    """A picture every so far, each of its own place; those in `sharp` are in focus."""
    for k, along in enumerate(alongs):
        yield Candidate(k, along, colour(scene(int(along // 1), 0.0 if k in sharp else 2.0)))


def test_the_sharpest_of_each_stretch_is_taken():
    tally = Tally()
    found = list(choose(walk(np.arange(0.0, 6.0, 0.25), sharp={3, 10, 23}), 2.0, tally))
    assert [one.candidate.stamp_ns for one in found] == [3, 10, 23]
    assert tally.seen == 24
    assert found[0].sharpness == sharpness(scene(0))


def test_standing_still_gives_one_picture_and_neighbours_keep_half_a_stretch_apart():
    assert len(list(choose(walk([0.0] * 30), 2.0, Tally()))) == 1
    alongs = [one.candidate.along for one in choose(walk(np.arange(90) / 10, sharp={19, 21}), 2.0, Tally())]
    assert 1.9 in alongs
    assert min(np.diff(alongs)) >= 1.0 - 1e-9


def test_what_looks_like_a_picture_before_or_like_a_known_one_is_left_out_and_so_is_what_is_blurred():
    def turned(seeds):
        return [Candidate(k, float(k), colour(scene(seed))) for k, seed in enumerate(seeds)]

    tally = Tally()
    found = list(choose(turned([1, 2, 1, 3]), 1.0, tally, known=[perceptual_hash(scene(3))]))
    assert [one.candidate.stamp_ns for one in found] == [0, 1]
    assert tally.alike == 2
    assert list(choose(turned([1]), 1.0, tally, least_sharpness=1e9)) == []
    assert tally.blurred == 1
