"""Perceptual hashes: 64 bits that change little when an image is resized or compressed again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
import numpy.typing as npt

NEAR_BITS = 4
"""Hashes that differ in at most so many bits are of one picture; unrelated ones differ in about 32."""
_BITS = np.array([bin(octet).count("1") for octet in range(256)], np.uint8)
_BLOCK = 512


def perceptual_hash(grey: npt.NDArray[np.uint8]) -> str:
    """Of a grey image (h, w), 16 hexadecimal digits: the signs of the 8x8 lowest cosine terms against their median."""
    small = cv2.resize(grey, (32, 32), interpolation=cv2.INTER_AREA).astype(np.float32)
    low = np.asarray(cv2.dct(small))[:8, :8].ravel()
    bits = low > np.median(low[1:])  # the first term is the brightness
    return np.packbits(bits).tobytes().hex()


def bits_apart(one: str, other: str) -> int:
    """In how many of the 64 bits two hashes differ."""
    return bin(int(one, 16) ^ int(other, 16)).count("1")


def near_pairs(hashes: Sequence[str], bits: int = NEAR_BITS) -> Iterator[tuple[int, int]]:
    """Places i < j of images whose hashes are near; images without a hash ("") are near to none."""
    known = np.array([place for place, text in enumerate(hashes) if text], np.int64)
    if not len(known):
        return
    octets = np.array([list(bytes.fromhex(hashes[place])) for place in known], np.uint8)
    for start in range(0, len(known), _BLOCK):
        block = octets[start : start + _BLOCK]
        apart = np.zeros((len(block), len(known) - start), np.uint8)
        for column in range(octets.shape[1]):
            apart += _BITS[block[:, column, None] ^ octets[None, start:, column]]
        for i, j in np.argwhere(apart <= bits):
            if i < j:
                yield int(known[start + i]), int(known[start + j])
