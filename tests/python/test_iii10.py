"""Theorem III.10: what its gains do at random points of the box, known and unknown premises alike."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.tracking.iii10 import TrackingCondition, tracking_condition
from quasilpv.lmi import Solution
from quasilpv.polytopes import BlockPolytope

DECAY, GAIN_LIMIT = 1.0, 1000.0
FREQUENCIES = np.concatenate([[0.0], np.geomspace(1e-2, 1e3, 200)])
# Premises: inertia and stiffness measured, friction unknown.
POLYTOPE = BlockPolytope.uncertain(([-1.0, -1.0], [1.0, 1.0]), ([-1.0], [1.0]))
DRIVE, OUTPUT = np.array([[0.0], [1.0], [0.0]]), np.array([[1.0, 0.0, 0.0]])


def descriptor(z: FloatArray) -> FloatArray:
    """(2 + z_1) w' = 3 z_2 theta - (0.5 + z_3) w + u + d with the state (theta, w, int theta)."""
    return np.diag([1.0, 2.0 + z[0], 1.0])


def state(z: FloatArray) -> FloatArray:
    return np.array([[0.0, 1.0, 0.0], [3.0 * z[1], -0.5 - z[2], 0.0], [1.0, 0.0, 0.0]])


def vertices(of: object) -> FloatArray:
    assert callable(of)
    zero, units = np.zeros(3), np.eye(3)
    return POLYTOPE.vertices(of(zero), np.array([of(unit) - of(zero) for unit in units]))


def condition(gain_limit: float = GAIN_LIMIT) -> TrackingCondition:
    return tracking_condition(
        vertices(descriptor),
        vertices(state),
        DRIVE,
        OUTPUT,
        decay=DECAY,
        gain_limit=gain_limit,
        blocks=POLYTOPE.block_index,
        shared_gain=POLYTOPE.shared_gain,
    )


@lru_cache(maxsize=1)
def solved() -> tuple[TrackingCondition, Solution]:
    problem = condition()
    return problem, problem.problem.solve_inside(0.05)


def closed(z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Frozen (A + B K, B) with the descriptor inverted, and K."""
    tracking, solution = solved()
    K = tracking.gain(solution, POLYTOPE.weights(z), descriptor(z))
    E = descriptor(z)
    mobility: FloatArray = np.diag(1.0 / np.diag(E))
    return mobility @ (state(z) + DRIVE @ K), mobility @ DRIVE, K


def points() -> FloatArray:
    rng = np.random.default_rng(4)
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    return np.vstack([corners, rng.uniform(-1, 1, (300, 3))])


def test_when_the_loop_is_frozen_anywhere_expect_the_decay_rate_and_the_gain_that_were_asked_for() -> None:
    tracking, solution = solved()
    assert solution.verified
    X = np.linalg.inv(solution.values[tracking.P])
    for z in points():
        A, B, _ = closed(z)
        assert np.linalg.eigvalsh(X @ A + A.T @ X + 2 * DECAY * X).max() < 0
        responses = (OUTPUT @ np.linalg.solve(1j * w * np.eye(3) - A, B) for w in FREQUENCIES)
        assert max(abs(response[0, 0]) for response in responses) ** 2 < solution.values[tracking.gamma][0, 0]


def test_when_only_the_unknown_premise_changes_expect_the_same_gain() -> None:
    for z in points()[:20]:
        other = np.array([z[0], z[1], -z[2]])
        np.testing.assert_allclose(closed(z)[2], closed(other)[2], rtol=1e-12)


def test_when_gains_are_read_expect_them_within_the_limit() -> None:
    for z in points():
        bound = GAIN_LIMIT * np.linalg.norm(np.linalg.inv(descriptor(z)), ord=2)
        assert np.linalg.norm(closed(z)[2], ord=2) < bound


def test_when_the_gain_limit_is_raised_expect_less_of_the_disturbance_in_the_error() -> None:
    tracking, solution = solved()
    looser = condition(4 * GAIN_LIMIT)
    result = looser.problem.solve_inside(0.05)
    assert result.verified
    assert 0 < result.values[looser.gamma][0, 0] < 0.5 * solution.values[tracking.gamma][0, 0]


def test_when_the_sign_of_a_kinematic_premise_is_unknown_expect_no_solution() -> None:
    hopeless = vertices(state)
    hopeless[-2:, 0, 1] = [-8.0, 8.0]  # theta' = +-w at the vertices of the unknown premise
    tracking = tracking_condition(
        vertices(descriptor),
        hopeless,
        DRIVE,
        OUTPUT,
        decay=DECAY,
        gain_limit=GAIN_LIMIT,
        blocks=POLYTOPE.block_index,
        shared_gain=POLYTOPE.shared_gain,
    )
    assert not tracking.problem.solve_inside(0.05).verified
