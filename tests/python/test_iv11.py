"""Theorem IV.11: the reduced form at points of the box, its scaling, its exact verdict, and the printed structure."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import pytest

from quasilpv.arrays import FloatArray
from quasilpv.conditions.tracking.iv11_literal import literal_feedback, literal_observer
from quasilpv.conditions.tracking.iv11_reduced import (
    FeedbackPoint,
    ObserverPoint,
    feedback_condition,
    observer_condition,
)
from quasilpv.lmi import Problem, to_rational
from quasilpv.polytopes import BlockPolytope

DECAY, DISK, NOISE = 0.1, 2.0, 0.1
FREQUENCIES = np.concatenate([[0.0], np.geomspace(1e-3, 1e2, 120)])


def box_of_inertias(joints: int, premises: int, seed: int, spread: float = 0.25) -> tuple[BlockPolytope, FloatArray]:
    """Random positive definite inertias, affine in premises of [-1, 1], as vertices of the Takagi-Sugeno polytope."""
    rng = np.random.default_rng(seed)
    slopes = rng.normal(size=(premises, joints, joints))
    slopes = spread / max(1, premises) * (slopes + slopes.swapaxes(1, 2)) / 2
    polytope = BlockPolytope.takagi_sugeno([-1.0] * premises, [1.0] * premises)
    return polytope, polytope.vertices(np.eye(joints), slopes)


POLYTOPE, INERTIA = box_of_inertias(joints=2, premises=2, seed=3)


@lru_cache(maxsize=1)
def feedback_point() -> FeedbackPoint:
    condition = feedback_condition(INERTIA, DECAY, DISK)
    return condition.point(condition.problem.solve_inside(0.05))


@lru_cache(maxsize=1)
def observer_point() -> ObserverPoint:
    condition = observer_condition(INERTIA, DECAY, DISK, NOISE)
    return condition.point(condition.problem.solve_inside(0.05))


def frozen_feedback(gains: FloatArray, inertia: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(A, B, C) of (e, e', int e) with w' = M^-1 (K xi + d), from the equations of motion."""
    n = len(inertia)
    one, none, mobility = np.eye(n), np.zeros((n, n)), np.linalg.inv(inertia)
    A = np.block([[none, one, none], [mobility @ gains], [one, none, none]])
    return A, np.vstack([none, mobility, none]), np.hstack([one, none, none])


def frozen_observer(gains: FloatArray, inertia: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(A, [B_d'' B_noise], C) of the estimation error, with the disturbance torque as output."""
    n = len(inertia)
    one, none = np.eye(n), np.zeros((n, n))
    chain = np.block(
        [[none, one, none, none], [none, none, np.linalg.inv(inertia), none], [none, none, none, one], [none] * 4]
    )
    A = chain - gains @ np.hstack([one, none, none, none])
    inputs = np.hstack([np.vstack([none, none, none, one]), -NOISE * gains])
    return A, inputs, np.hstack([none, none, one, none])


def peak_gain(A: FloatArray, B: FloatArray, C: FloatArray) -> float:
    """Largest singular value of C (jw - A)^-1 B on a frequency grid: a lower bound of the H-infinity norm."""
    responses = (C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) for w in FREQUENCIES)
    return max(float(np.linalg.norm(response, ord=2)) for response in responses)


def largest_eigenvalue(matrix: FloatArray) -> float:
    return float(np.linalg.eigvalsh((matrix + matrix.T) / 2)[-1])


def premises(count: int, size: int = 2) -> FloatArray:
    rng = np.random.default_rng(11)
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * size)).reshape(size, -1).T
    return np.vstack([corners, rng.uniform(-1, 1, (count, size))])


def test_when_the_feedback_is_frozen_anywhere_expect_decay_disk_and_gain_of_the_certificate() -> None:
    point = feedback_point()
    for z in premises(200):
        weights = POLYTOPE.weights(z)
        K, M = np.tensordot(weights, point.gains, 1), np.tensordot(weights, INERTIA, 1)
        A, B, C = frozen_feedback(K, M)
        assert largest_eigenvalue(A @ point.P + point.P @ A.T + 2 * DECAY * point.P) < 0
        assert largest_eigenvalue(A @ point.P @ A.T - DISK**2 * point.P) < 0
        assert np.linalg.eigvals(A).real.max() < -DECAY
        assert np.abs(np.linalg.eigvals(A)).max() < DISK
        assert peak_gain(A, B, C) ** 2 < point.gamma


def test_when_the_observer_is_frozen_anywhere_expect_decay_disk_and_gain_of_the_certificate() -> None:
    point = observer_point()
    for z in premises(200):
        weights = POLYTOPE.weights(z)
        L, M = np.tensordot(weights, point.gains, 1), np.tensordot(weights, INERTIA, 1)
        A, B, C = frozen_observer(L, M)
        assert largest_eigenvalue(point.Q @ A + A.T @ point.Q + 2 * DECAY * point.Q) < 0
        assert largest_eigenvalue(A.T @ point.Q @ A - DISK**2 * point.Q) < 0
        assert np.linalg.eigvals(A).real.max() < -DECAY
        assert np.abs(np.linalg.eigvals(A)).max() < DISK
        assert peak_gain(A, B, C) ** 2 < point.gamma


def test_when_the_gain_is_minimised_expect_a_bound_close_to_the_gain_there_is() -> None:
    point = feedback_point()
    frozen = [frozen_feedback(point.gains[i], INERTIA[i]) for i in range(len(INERTIA))]
    assert max(peak_gain(*system) for system in frozen) ** 2 > 0.5 * point.gamma


def test_when_the_multiplier_is_scheduled_expect_a_bound_no_larger() -> None:
    inertia = np.array([[[0.7]], [[1.4]]])
    common, scheduled = (
        observer_condition(inertia, DECAY, DISK, NOISE, scheduled_multiplier=choice).problem.solve().objective
        for choice in (False, True)
    )
    assert 0 < scheduled < common * (1 + 1e-6)


@pytest.mark.parametrize(("rate", "inertia"), [(60.0, 8.0), (0.37, 1.3)])
def test_when_a_point_is_scaled_expect_a_point_of_the_scaled_problem(rate: float, inertia: float) -> None:
    larger = to_rational(inertia * INERTIA)
    feedback = feedback_point().scaled(rate, inertia)
    observer = observer_point().scaled(rate, inertia)
    assert (feedback.decay, feedback.disk) == (DECAY * rate, DISK * rate)
    assert feedback_condition(larger, Fraction(feedback.decay), Fraction(feedback.disk)).holds_at(feedback)
    assert observer_condition(
        larger, Fraction(observer.decay), Fraction(observer.disk), Fraction(observer.noise)
    ).holds_at(observer)
    unscaled = np.linalg.eigvals(frozen_feedback(feedback_point().gains[0], INERTIA[0])[0])
    scaled = np.linalg.eigvals(frozen_feedback(feedback.gains[0], inertia * INERTIA[0])[0])
    np.testing.assert_allclose(np.sort_complex(scaled), rate * np.sort_complex(unscaled), rtol=1e-6)


def test_when_gains_or_bounds_are_changed_expect_the_exact_check_to_refuse() -> None:
    exact = to_rational(INERTIA)
    point = feedback_point()
    condition = feedback_condition(exact, Fraction(DECAY), Fraction(DISK))
    assert condition.holds_at(point)
    for changed in (
        FeedbackPoint(point.decay, point.disk, 0.9 * point.gamma, point.P, point.gains),
        FeedbackPoint(point.decay, point.disk, point.gamma, point.P, -point.gains),
        FeedbackPoint(point.decay, point.disk, point.gamma, point.P, 1.5 * point.gains),
        FeedbackPoint(point.decay, point.disk, point.gamma, -point.P, point.gains),
    ):
        assert not condition.holds_at(changed)
    seen = observer_point()
    observer = observer_condition(exact, Fraction(DECAY), Fraction(DISK), Fraction(NOISE))
    assert observer.holds_at(seen)
    for name in seen.multipliers:
        without = {**seen.multipliers, name: 0 * seen.multipliers[name]}
        changed_point = ObserverPoint(DECAY, DISK, NOISE, seen.gamma, seen.Q, seen.gains, without)
        assert not observer.holds_at(changed_point)
    smaller = ObserverPoint(DECAY, DISK, NOISE, 0.8 * seen.gamma, seen.Q, seen.gains, seen.multipliers)
    assert not observer.holds_at(smaller)


def test_when_one_observer_matrix_serves_a_joint_expect_a_limit_on_the_inertia_ratio() -> None:
    """The limit behind the choice of scheduled premises; between 5 and 6 for these decay and disk."""

    def outcome(ratio: float) -> bool:
        inertia = np.array([[[1.0]], [[ratio]]]) / math.sqrt(ratio)
        return observer_condition(inertia, 2.0 / 16.0, 2.0, NOISE).problem.solve_inside().verified

    assert [outcome(ratio) for ratio in (2.0, 3.0, 6.0, 10.0)] == [True, True, False, False]


# ---- the printed structure ------------------------------------------------------------------------------------------


def random_problem(seed: int) -> tuple[FloatArray, npt.NDArray[np.intp], float, float]:
    """One or two joints, one or two premises, inertias definite over the box or not; decay rate and gain bound."""
    rng = np.random.default_rng(seed)
    joints, count = [(1, 1), (1, 1), (1, 2), (2, 1)][seed % 4]
    polytope = BlockPolytope.per_premise([-1.0] * count, [1.0] * count)
    slopes = rng.normal(size=(count, joints, joints))
    slopes = slopes + slopes.swapaxes(1, 2)
    size = rng.choice([0.5, 1.6]) / sum(np.abs(np.linalg.eigvalsh(slope)).max() for slope in slopes)
    inertia = rng.uniform(0.5, 4.0) * polytope.vertices(np.eye(joints), size * slopes)
    return inertia, polytope.block_index, float(rng.uniform(0.05, 1.0)), float(rng.uniform(0.5, 5.0))


def is_feasible(problem: Problem) -> bool:
    return problem.solve_inside().verified


def reduced_feasibility(inertia: FloatArray, decay: float, gamma: float, blocks: npt.NDArray[np.intp]) -> list[bool]:
    feedback = feedback_condition(inertia, decay, slack_blocks=blocks)
    feedback.problem.negative("gamma", feedback.gamma - np.array([[gamma]]))
    observer = observer_condition(inertia, decay, math.inf, NOISE, scheduled_multiplier=True, slack_blocks=blocks)
    return [is_feasible(feedback.problem), is_feasible(observer.problem)]


def assert_that_both_forms_agree(seed: int) -> None:
    inertia, blocks, decay, gamma = random_problem(seed)
    literal = [
        is_feasible(literal_feedback(inertia, decay, gamma, blocks)),
        is_feasible(literal_observer(inertia, decay, 0.2 / decay, blocks)),
    ]
    assert literal == reduced_feasibility(inertia, decay, gamma, blocks), f"seed {seed}, inertia {inertia.tolist()}"


@pytest.mark.parametrize("seed", [0, 1, 4, 5, 8, 9, 12, 13])
def test_when_a_problem_is_small_expect_the_printed_and_the_reduced_form_to_agree(seed: int) -> None:
    assert_that_both_forms_agree(seed)


@pytest.mark.full
@pytest.mark.parametrize("seed", range(50))
def test_when_problems_are_random_expect_the_printed_and_the_reduced_form_to_agree(seed: int) -> None:
    assert_that_both_forms_agree(seed)


def test_when_the_sample_of_problems_is_drawn_expect_feasible_and_infeasible_ones() -> None:
    verdicts = [reduced_feasibility(*_reordered(random_problem(seed))) for seed in (0, 1, 4, 5, 8, 9, 12, 13)]
    assert {tuple(verdict) for verdict in verdicts} >= {(True, True), (False, False)}


def _reordered(
    problem: tuple[FloatArray, npt.NDArray[np.intp], float, float],
) -> tuple[FloatArray, float, float, npt.NDArray[np.intp]]:
    inertia, blocks, decay, gamma = problem
    return inertia, decay, gamma, blocks
