import math
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.odometry.config import ImuConfig, MatchConfig
from pipeline.odometry.filter import Filter
from pipeline.odometry.footing import LONGEST_S, Footing
from pipeline.odometry.state import ERRORS, State

S = 1_000_000_000


def state(yaw=0.0, velocity=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0)):
    turn = Rotation.from_euler("ZYX", [yaw, 0.1, -0.05]).as_matrix()
    return State(turn, np.array(position), np.array(velocity), *np.zeros((2, 3)), np.array([0.0, 0.0, -9.8]))


def started(velocity=(0.0, 0.0, 0.0)):
    covariance = np.diag(np.arange(1.0, ERRORS + 1.0))
    covariance[6, 7] = covariance[7, 6] = 2.0
    return Filter(state(velocity=velocity), covariance, ImuConfig(), MatchConfig())


def test_the_first_start_stands_as_it_is():
    first = started((1.0, 0.0, 0.0))
    assert Footing().place(first, 5 * S).state is first.state


def test_after_a_break_heading_goes_on_and_the_way_is_that_of_the_mean_speed():
    old = state(yaw=1.0, velocity=(1.0, 0.0, 0.0), position=(5.0, 6.0, 7.0))
    placed = Footing(old, 10 * S).place(started((2.0, 0.0, 0.0)), 13 * S)
    ahead = placed.state.rotation @ [1.0, 0.0, 0.0]
    assert abs(math.atan2(ahead[1], ahead[0]) - 1.0) < 1e-9
    velocity = 2.0 * np.array([math.cos(1.0), math.sin(1.0), 0.0])
    np.testing.assert_allclose(placed.state.velocity_m_s, velocity, atol=1e-9)
    np.testing.assert_allclose(placed.state.position_m, [5, 6, 7] + 1.5 * (np.array([1, 0, 0]) + velocity), atol=1e-9)
    turn = Rotation.from_euler("z", 1.0).as_matrix()
    np.testing.assert_allclose(placed.covariance[6:9, 6:9], turn @ started().covariance[6:9, 6:9] @ turn.T, atol=1e-9)


def test_the_way_over_a_long_break_is_not_guessed():
    old = state(velocity=(1.0, 0.0, 0.0))
    placed = Footing(old, 0).place(started((1.0, 0.0, 0.0)), 1000 * S)
    assert placed.state.position_m[0] <= LONGEST_S


def test_a_state_that_is_no_number_is_no_footing():
    old = replace(state(), position_m=np.array([np.nan, 0.0, 0.0]))
    placed = Footing(old, 0).place(started(), S)
    assert np.isfinite(placed.state.flat()).all()


def test_what_may_have_happened_grows_with_the_time_away():
    assert Footing().doubt(5 * S) == (0.0, 0.0)
    old = Footing(state(velocity=(1.0, 0.0, 0.0)), 0, known_m=0.5)
    (near_m, near_rad), (far_m, far_rad) = old.doubt(S), old.doubt(10 * S)
    assert 1.0 < near_m < far_m < 25.0
    assert 0.0 < near_rad < far_rad < math.pi
    unseen = Footing(state(velocity=(1.0, 0.0, 0.0)), 0, known_m=0.5, lost_s=9.0)
    assert unseen.doubt(S) == old.doubt(10 * S)
    assert np.isfinite(Footing(replace(state(), velocity_m_s=np.full(3, np.nan)), 0, known_m=math.nan).doubt(S)).all()


def test_it_is_said_once():
    footing = Footing(state(), 0, "restarted: why")
    assert footing.say() == "restarted: why"
    assert not footing.say()
