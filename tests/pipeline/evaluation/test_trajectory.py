"""Errors of trajectories agree with `evo`, and with what was put in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.evaluation.trajectory import Trajectory, aligned, read_tum, trajectory_errors
from pipeline.products.tum import write_tum

S = 1_000_000_000


def loop(count: int = 400, start_ns: int = 0) -> Trajectory:
    angles = np.linspace(0, 2 * np.pi, count)
    positions = np.column_stack([40 * np.cos(angles), 40 * np.sin(angles), 2 * np.sin(3 * angles)])
    rotations = Rotation.from_euler("zyx", np.column_stack([angles, 0.1 * np.sin(angles), 0 * angles])).as_matrix()
    return Trajectory(start_ns + (np.arange(count) * S // 10), positions, rotations)


def disturbed(truth: Trajectory, sigma_m: float = 0.2, seed: int = 1) -> Trajectory:
    noise = np.random.default_rng(seed)
    count = len(truth.stamps_ns)
    tilt = Rotation.from_rotvec(noise.normal(0, 0.01, (count, 3))).as_matrix()
    return Trajectory(truth.stamps_ns, truth.positions_m + noise.normal(0, sigma_m, (count, 3)), truth.rotations @ tilt)


def moved(one: Trajectory, turn: np.ndarray) -> Trajectory:
    return Trajectory(one.stamps_ns, one.positions_m @ turn.T + [3.0, -7.0, 2.0], turn @ one.rotations)


@pytest.mark.parametrize(("kind", "euler"), [("yaw", [1.0, 0, 0]), ("se3", [1.0, -0.4, 0.2])])
def test_an_alignment_undoes_what_was_done(kind, euler):
    truth = loop()
    away = moved(truth, Rotation.from_euler("zyx", euler).as_matrix())
    np.testing.assert_allclose(aligned(away, truth, kind).positions_m, truth.positions_m, atol=1e-9)
    errors = trajectory_errors(away, truth, kind, rpe_over_m=20.0)
    assert errors.ape_m.worst < 1e-9
    assert errors.ape_deg.worst < 1e-5
    assert trajectory_errors(away, truth).ape_m.rmse > 5
    assert trajectory_errors(away, truth).drift_percent < 1e-9


@pytest.mark.parametrize("align", [False, True])
def test_ape_and_rpe_agree_with_evo(align):
    metrics = pytest.importorskip("evo.core.metrics", reason="evo is not installed; the benchmark compares with it")
    from evo.core.trajectory import PoseTrajectory3D  # noqa: PLC0415

    truth = loop()
    estimate = moved(disturbed(truth), Rotation.from_euler("zyx", [0.5, 0.1, 0.0]).as_matrix())

    def theirs(one):
        quaternions = np.roll(Rotation.from_matrix(one.rotations).as_quat(), 1, axis=1)
        return PoseTrajectory3D(one.positions_m, quaternions, one.stamps_ns / 1e9)

    pair = (theirs(truth), theirs(estimate))
    if align:
        pair[1].align(pair[0])
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data(pair)
    ours = trajectory_errors(estimate, truth, "se3" if align else "none", rpe_over_m=10.0)
    for name, statistic in (("rmse", "rmse"), ("mean", "mean"), ("median", "median"), ("max", "worst")):
        assert ape.get_all_statistics()[name] == pytest.approx(getattr(ours.ape_m, statistic), rel=1e-6)
    rpe = metrics.RPE(
        metrics.PoseRelation.translation_part, 10.0, metrics.Unit.meters, all_pairs=True, rel_delta_tol=0.1
    )
    rpe.process_data(pair)
    assert rpe.get_all_statistics()["rmse"] == pytest.approx(ours.rpe_m.rmse, rel=0.05)


def test_truth_is_interpolated_at_the_estimates_stamps():
    truth = loop(4000)
    truth = Trajectory(truth.stamps_ns // 10, truth.positions_m, truth.rotations)
    between = truth.at(truth.stamps_ns[:-1:10] + 3_000_000)
    errors = trajectory_errors(between, truth, rpe_over_m=50.0)
    assert errors.ape_m.worst < 1e-9


def test_honest_covariance_has_a_nees_of_one_and_a_boastful_one_more():
    truth = loop(4000)
    estimate = disturbed(truth, 0.3)
    honest = np.tile(np.eye(3) * 0.09, (4000, 1, 1))
    errors = trajectory_errors(replace(estimate, covariance=honest), truth)
    assert errors.nees == pytest.approx(1.0, abs=0.06)
    assert errors.within_95 == pytest.approx(0.95, abs=0.015)
    assert trajectory_errors(replace(estimate, covariance=honest / 100), truth).nees > 50
    assert np.isnan(trajectory_errors(replace(estimate, covariance=honest), truth, "se3").nees)


def test_trajectories_are_read_to_the_nanosecond_and_others_refused(tmp_path: Path):
    truth = loop(50, 1_790_000_000 * S + 123_456_789)
    write_tum(tmp_path / "a.tum", truth.stamps_ns, truth.positions_m, truth.rotations)
    read = read_tum(tmp_path / "a.tum")
    np.testing.assert_array_equal(read.stamps_ns, truth.stamps_ns)
    np.testing.assert_allclose(read.rotations, truth.rotations, atol=1e-8)
    (tmp_path / "b.tum").write_text("1 2 3\n")
    with pytest.raises(ValueError, match="eight numbers"):
        read_tum(tmp_path / "b.tum")
    with pytest.raises(ValueError, match="do not overlap"):
        trajectory_errors(loop(50), truth)
