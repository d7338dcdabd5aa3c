"""How sharp a map is, and how far surfaces are apart that it has twice: what needs no ground truth.

Mean map entropy: Droeschel, Behnke (ICRA 2014); with the mean plane variance: Razlaw, Droeschel, Holz, Behnke (ECMR
2015). Distance of surfaces along their normal: as in M3C2 (Lague, Brodu, Leroux 2013).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

Doubles = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Rows = npt.NDArray[np.intp]
LEAST = 10
"""Neighbours that tell a covariance."""
LEAST_EACH = 5
"""Points of either pass that tell where its surface is."""
FLAT = 0.1
"""Least eigenvalue over the middle one: what is flatter is a surface, not leaves."""
LEVEL = 0.8
"""Upward part of the normal of a surface that counts as level."""
_AT_ONCE = 500


@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """Of the places with enough neighbours. entropy: (n,). thickness_m: (n,) upper quartile of the distances of the
    neighbours to their plane. flat: (n,)."""

    entropy: Doubles
    thickness_m: Doubles
    flat: Bools


@dataclass(frozen=True, slots=True, eq=False)
class Apart:
    """Of the places where two passes show a surface. distance_m: (n,) from the earlier to the later, along the normal,
    which points up. level: (n,)."""

    distance_m: Doubles
    level: Bools


def around(xyz: Doubles, places: Rows, radius_m: float) -> Around:
    """xyz: (n, 3). places: (k,) rows of it."""
    entropy, thickness, flat = [np.empty(0)], [np.empty(0)], [np.empty(0, np.bool_)]
    for _, near in _neighbours(xyz, places, radius_m):
        count, mean, values, vectors = near.planes()
        told = (count >= LEAST) & (values[:, 0] > 0.0)
        # h = 1/2 ln |2 pi e S|, equation 2 of Razlaw et al.
        entropy.append(0.5 * (3.0 * np.log(2.0 * np.pi * np.e) + np.log(values[told]).sum(axis=1)))
        away = np.abs(near.along(vectors[:, :, 0]) - (mean * vectors[:, :, 0]).sum(axis=1)[near.place])
        thickness.append(near.upper_quartile(away)[told])
        flat.append(values[told, 0] < FLAT * values[told, 1])
    return Around(np.concatenate(entropy), np.concatenate(thickness), np.concatenate(flat))


def apart(xyz: Doubles, places: Rows, other: Callable[[Rows, Rows], Bools], order: Doubles, radius_m: float) -> Apart:
    """other: whether points (m,) are of another pass than places (m,), both rows of xyz (n, 3). order: (n,), greater of
    the later.

    The normal is that of the other pass in the radius, if that is flat there; the surfaces are where the points of
    either lie in the mean, in half the radius around the normal.
    """
    distance, level = [np.empty(0)], [np.empty(0, np.bool_)]
    for some, near in _neighbours(xyz, places, radius_m):
        theirs = other(near.rows, some[near.place])
        count, _, values, vectors = near.where(theirs).planes()
        normal = np.where(vectors[:, 2:, 0] < 0.0, -1.0, 1.0) * vectors[:, :, 0]
        along = near.along(normal)
        core = np.sqrt(np.maximum((near.offset**2).sum(axis=1) - along**2, 0.0)) < 0.5 * radius_m
        (mine, here), (others, there) = (near.mean(along, core & kept) for kept in (~theirs, theirs))
        told = (count >= LEAST) & (values[:, 0] < FLAT * values[:, 1]) & (np.minimum(mine, others) >= LEAST_EACH)
        later = near.mean(order[near.rows], ~theirs)[1] > near.mean(order[near.rows], theirs)[1]
        distance.append((np.where(later, 1.0, -1.0) * (here - there))[told])
        level.append(normal[told, 2] > LEVEL)
    return Apart(np.concatenate(distance), np.concatenate(level))


@dataclass(frozen=True, slots=True, eq=False)
class _Near:
    """The neighbours of some places. rows: (m,) of the cloud; place: (m,) whose, 0 to size; offset: (m, 3) from it."""

    rows: Rows
    place: Rows
    offset: Doubles
    size: int

    def where(self, kept: Bools) -> _Near:
        return _Near(self.rows[kept], self.place[kept], self.offset[kept], self.size)

    def sums(self, values: Doubles) -> Doubles:
        """(size,)."""
        return np.asarray(np.bincount(self.place, values, self.size), np.float64)

    def planes(self) -> tuple[Rows, Doubles, Doubles, Doubles]:
        """Counts (size,), means (size, 3), eigenvalues ascending (size, 3) and eigenvectors (size, 3, 3) of sample
        covariances."""
        count = np.bincount(self.place, minlength=self.size)
        some = np.maximum(count, 1)
        mean = np.stack([self.sums(self.offset[:, k]) for k in range(3)], axis=1) / some[:, None]
        centred = self.offset - mean[self.place]
        covariance = np.empty((self.size, 3, 3))
        for i in range(3):
            for j in range(i + 1):
                products = self.sums(centred[:, i] * centred[:, j])
                covariance[:, i, j] = covariance[:, j, i] = products / np.maximum(count - 1, 1)
        values, vectors = np.linalg.eigh(covariance)
        return count, mean, values, vectors

    def along(self, direction: Doubles) -> Doubles:
        """(m,) offsets along the directions (size, 3) of their places."""
        return np.asarray((self.offset * direction[self.place]).sum(axis=1))

    def mean(self, values: Doubles, kept: Bools) -> tuple[Rows, Doubles]:
        """Counts and means (size,) of the values (m,) that are kept."""
        count = np.bincount(self.place[kept], minlength=self.size)
        return count, np.bincount(self.place[kept], values[kept], self.size) / np.maximum(count, 1)

    def upper_quartile(self, values: Doubles) -> Doubles:
        """(size,) of values (m,): three quarters are not greater."""
        ordered = values[np.lexsort((values, self.place))]
        count = np.bincount(self.place, minlength=self.size)
        first = np.cumsum(count) - count
        at = first + np.maximum(np.ceil(0.75 * count).astype(np.intp) - 1, 0)
        return np.asarray(ordered[np.minimum(at, len(ordered) - 1)])


def _neighbours(xyz: Doubles, places: Rows, radius_m: float) -> Iterator[tuple[Rows, _Near]]:
    """Some of the places at a time; each is its own neighbour."""
    if not len(places):
        return
    tree = cKDTree(xyz)
    for first in range(0, len(places), _AT_ONCE):
        some = places[first : first + _AT_ONCE]
        found = [np.asarray(rows, np.intp) for rows in tree.query_ball_point(xyz[some], radius_m, return_sorted=False)]
        count = np.array([rows.size for rows in found])
        rows = np.concatenate(found)
        place = np.repeat(np.arange(len(some)), count)
        yield some, _Near(rows, place, xyz[rows] - xyz[some][place], len(some))
