"""Perceptual hashes: 64 bits that change little when an image is resized or compressed again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import cv2
import numpy as np
import numpy.typing as npt

NEAR_BITS = 4
"""Hashes that differ in at most so many bits are of one picture; unrelated ones differ in about 32."""


def perceptual_hash(grey: npt.NDArray[np.uint8]) -> str:
    """Of a grey image (h, w), 16 hexadecimal digits: the signs of the 8x8 lowest cosine terms against their median."""
    small = cv2.resize(grey, (32, 32), interpolation=cv2.INTER_AREA).astype(np.float32)
    low = np.asarray(cv2.dct(small))[:8, :8].ravel()
    bits = low > np.median(low[1:])  # the first term is the brightness
    return np.packbits(bits).tobytes().hex()


class HashIndex:
    """Hashes by the order they were added, to find the near ones among many.

    Of bits + 1 parts of two near hashes one is the same in both, so only those with a part in common are compared.
    """

    def __init__(self, known: Iterable[str] = (), bits: int = NEAR_BITS) -> None:
        self._bits = bits
        self._width = -(-64 // (bits + 1))
        self._words: list[int | None] = []
        self._parts: list[dict[int, list[int]]] = [{} for _ in range(0, 64, self._width)]
        for text in known:
            self.add(text)

    def add(self, text: str) -> None:
        """The next one; "" takes a place and is near to none."""
        word = int(text, 16) if text else None
        if word is not None:
            for part, places in zip(self._split(word), self._parts, strict=True):
                places.setdefault(part, []).append(len(self._words))
        self._words.append(word)

    def near(self, text: str) -> list[int]:
        """Places of those that are near, in order."""
        if not text:
            return []
        word = int(text, 16)
        parts = zip(self._split(word), self._parts, strict=True)
        candidates = {place for part, places in parts for place in places.get(part, ())}
        return sorted(p for p in candidates if bin(word ^ (self._words[p] or 0)).count("1") <= self._bits)

    def _split(self, word: int) -> list[int]:
        return [word >> shift & (1 << self._width) - 1 for shift in range(0, 64, self._width)]


def near_pairs(hashes: Iterable[str], bits: int = NEAR_BITS) -> Iterator[tuple[int, int]]:
    """Places i < j of images whose hashes are near."""
    index = HashIndex(bits=bits)
    for j, text in enumerate(hashes):
        yield from ((i, j) for i in index.near(text))
        index.add(text)
