"""Submaps are laid on each other where they belong, and what cannot be told is said to be so."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("small_gicp", reason="small_gicp is not installed")

from pipeline.refinement.candidates import guesses
from pipeline.refinement.config import ClosureConfig
from pipeline.refinement.registration import Cloud, register


def stand(stems, seed):
    """Points of stems (s, 2) and of a bumpy ground around the origin, as one visit samples them."""
    random = np.random.default_rng(seed)
    parts = []
    for x, y in stems:
        angle, height = random.uniform(0, 2 * np.pi, 400), random.uniform(0.0, 6.0, 400)
        parts.append(np.column_stack([x + 0.15 * np.cos(angle), y + 0.15 * np.sin(angle), height]))
    ground = random.uniform(-18.0, 18.0, (9000, 2))
    parts.append(np.column_stack([ground, 0.3 * np.sin(0.5 * ground[:, 0]) * np.cos(0.4 * ground[:, 1])]))
    return np.concatenate(parts) + 0.02 * random.standard_normal((400 * len(stems) + 9000, 3))


def moved(x, y, yaw):
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    pose[:2, 3] = x, y
    return pose


def seen_from(pose, points):
    return (points - pose[:3, 3]) @ pose[:3, :3]


WILD = np.random.default_rng(5).uniform(-16.0, 16.0, (40, 2))


def test_a_wild_stand_seen_twice_is_recognised_to_centimetres():
    true = moved(1.2, -0.8, 0.2)
    target, source = Cloud(stand(WILD, 1)), Cloud(seen_from(true, stand(WILD, 2)))
    found = register(target, source, guesses(moved(0.4, -0.2, 0.12), 1.0), ClosureConfig())
    assert np.abs(found.pose - true).max() < 0.05
    assert found.overlap > 0.7
    assert found.rival_m == np.inf
    assert not found.weak
    assert 0.02 < np.sqrt(np.trace(found.covariance[3:, 3:])) < 0.2


def test_rows_of_a_plantation_are_ambiguous():
    rows = np.array([(x, y) for x in np.arange(-16.0, 17.0, 2.0) for y in np.arange(-16.0, 17.0, 2.0)])
    flat = [stand(rows, seed) * [1.0, 1.0, 1.0] for seed in (1, 2)]
    for points in flat:
        points[-9000:, 2] = 0.0
    found = register(Cloud(flat[0]), Cloud(flat[1]), guesses(moved(0.2, 0.1, 0.0), 1.0), ClosureConfig())
    assert found.rival_m == pytest.approx(2.0, abs=0.3)


def test_other_places_do_not_overlap():
    other = np.random.default_rng(6).uniform(-16.0, 16.0, (40, 2))
    hilly = stand(other, 3)
    hilly[:, 2] += 0.15 * hilly[:, 0]
    found = register(Cloud(stand(WILD, 1)), Cloud(hilly), guesses(np.eye(4), 0.5), ClosureConfig())
    assert found.overlap < ClosureConfig().least_overlap


def test_a_meadow_leaves_directions_open():
    flat = [stand(np.empty((0, 2)), seed) * [1.0, 1.0, 0.0] for seed in (1, 2)]
    assert register(Cloud(flat[0]), Cloud(flat[1]), [np.eye(4)], ClosureConfig()).weak
