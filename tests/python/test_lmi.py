"""The LMI vocabulary: algebra, exactness, and solutions against an independent modelling tool."""

from fractions import Fraction

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quasilpv.lmi import (
    Outcome,
    Problem,
    Variable,
    block,
    constant,
    he,
    identity,
    is_positive_definite,
    to_rational,
    zeros,
)

seeds = st.integers(0, 2**32 - 1)


@given(seeds)
def test_when_expressions_are_combined_expect_the_value_numpy_gives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    X, S, t = Variable("X", 2, 3), Variable("S", 2, symmetric=True), Variable("t", 1)
    A, B, C = rng.normal(size=(3, 2)), rng.normal(size=(3, 2)), rng.normal(size=(2, 2))
    x, s, tau = rng.normal(size=(2, 3)), rng.normal(size=(2, 2)), rng.normal(size=(1, 1))
    s = s + s.T
    expression = block([[S * 2 - C, X], [None, he(A @ X) - t * (A @ B.T)]])
    lower = A @ x + x.T @ A.T - tau[0, 0] * (A @ B.T)
    expected = np.block([[2 * s - C, x], [x.T, lower]])
    assert np.allclose(expression.at({X: x, S: s, t: tau}).astype(float), expected, atol=1e-12)


@given(seeds)
def test_when_the_point_is_rational_expect_an_exact_value(seed: int) -> None:
    rng = np.random.default_rng(seed)
    X = Variable("X", 2, symmetric=True)
    A = to_rational(rng.integers(-9, 9, size=(2, 2))) / 7
    x = to_rational(rng.integers(-9, 9, size=(2, 2))) / 3
    x = x + x.T
    value = he(A @ X @ A.T).at({X: x})
    assert all(isinstance(entry, Fraction) for entry in value.flat)
    assert (value == 2 * (A @ x @ A.T)).all()


def test_when_shapes_disagree_expect_a_clear_error() -> None:
    X = Variable("X", 2, 3)
    with pytest.raises(ValueError, match=r"\(2, 3\).*\(2, 2\)"):
        X + np.eye(2)
    with pytest.raises(ValueError, match="block"):
        block([[X, zeros(2, 1)], [zeros(1, 2), identity(1)]])
    with pytest.raises(ValueError, match="mirror"):
        block([[identity(1), None], [None, identity(1)]])
    with pytest.raises(ValueError, match="square"):
        Problem().positive("rectangular", X)


@given(seeds, st.integers(1, 6))
def test_when_a_matrix_is_tested_exactly_expect_the_sign_of_its_eigenvalues(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    factor = rng.integers(-4, 5, size=(size, size))
    matrix = factor @ factor.T - int(rng.integers(0, 3)) * np.eye(size, dtype=int)
    lowest = np.linalg.eigvalsh(matrix.astype(float))[0]
    if abs(lowest) > 1e-9:
        assert is_positive_definite(matrix.astype(object)) == (lowest > 0)


def test_when_a_matrix_is_singular_or_asymmetric_expect_no_certificate() -> None:
    assert not is_positive_definite(np.array([[1, 1], [1, 1]], dtype=object))
    tiny = Fraction(1, 10**60)
    assert is_positive_definite(np.array([[1, 1], [1, 1 + tiny]], dtype=object))
    with pytest.raises(ValueError, match="symmetric"):
        is_positive_definite(np.array([[1, 2], [1, 1]], dtype=object))


@settings(deadline=None, max_examples=15)
@given(seeds)
def test_when_a_random_lyapunov_program_is_solved_expect_the_optimum_of_cvxpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 3))
    A *= 0.9 / np.max(np.abs(np.linalg.eigvals(A)))
    P = Variable("P", 3, symmetric=True)
    problem = Problem()
    problem.positive("Stein", P - A.T @ P @ A - np.eye(3))
    problem.positive("P", P)
    trace = sum((np.eye(3)[[i]] @ P @ np.eye(3)[[i]].T for i in range(1, 3)), np.eye(3)[[0]] @ P @ np.eye(3)[[0]].T)
    problem.minimise(trace)
    ours = problem.solve()
    Q = cp.Variable((3, 3), symmetric=True)
    reference = cp.Problem(cp.Minimize(cp.trace(Q)), [Q - A.T @ Q @ A >> np.eye(3), Q >> 0])
    reference.solve(solver=cp.SCS, eps=1e-9, max_iters=100_000)
    assert ours.objective == pytest.approx(reference.value, rel=1e-5)


def test_when_asked_for_an_interior_point_expect_a_proof_and_little_loss() -> None:
    A = np.array([[0.5, 1.0], [0.0, 0.4]])
    P = Variable("P", 2, symmetric=True)
    problem = Problem()
    problem.positive("Stein", P - A.T @ P @ A - np.eye(2))
    corner = np.array([[1.0, 0.0]])
    problem.minimise(corner @ P @ corner.T)
    boundary, inside = problem.solve(), problem.solve_inside(back_off=0.05)
    assert inside.outcome is Outcome.VERIFIED
    assert min(inside.margins.values()) > 1e-6
    assert boundary.objective <= inside.objective <= 1.05 * boundary.objective + 1e-6


def test_when_a_candidate_is_nudged_off_the_feasible_set_expect_the_exact_check_to_refuse_it() -> None:
    P = Variable("P", 2, symmetric=True)
    problem = Problem()
    problem.positive("P > I", P - np.eye(2))
    assert problem.holds_exactly({P: (1 + 1e-15) * np.eye(2)})
    assert not problem.holds_exactly({P: np.eye(2)})


def test_when_a_program_is_infeasible_expect_that_outcome_and_no_values() -> None:
    x = Variable("x", 1)
    problem = Problem()
    problem.positive("above", x - np.array([[1.0]]))
    problem.positive("below", constant([[0.0]]) - x)
    solution = problem.solve_inside()
    assert solution.outcome is Outcome.INFEASIBLE_NUMERICALLY
    assert not solution.values
    assert not solution.verified
