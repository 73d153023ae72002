"""Compiled inequalities, families affine in parameters, and decisions that are proved."""

import math
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy import sparse

from quasilpv.lmi import Outcome, Problem, Variable, block, he, is_positive_definite, largest_margin, to_rational
from quasilpv.lmi.common import common_problem
from quasilpv.lmi.compiled import CompiledProblem, compile_family, rounded
from quasilpv.lmi.feasibility import decide
from quasilpv.lmi.independence import independent_columns

SEEDS = st.integers(0, 2**32 - 1)


def lyapunov(A: np.ndarray) -> Problem:
    """``P > 0, A P + P A' < 0`` as exact data."""
    exact = np.array([[Fraction(float(entry)) for entry in row] for row in A], dtype=object)
    P = Variable("P", len(A), symmetric=True)
    problem = Problem()
    problem.positive("P", P)
    problem.negative("decrease", he(exact @ P))
    return problem


def random_problem(seed: int) -> Problem:
    """Two inequalities in a symmetric, a rectangular and a scalar unknown, with data of all kinds of number.

    They hold at P = 5 I, Y = 0, t = 1, since |A + 9 I| <= 27/7 and the random matrices are small beside 5 He(A).
    """
    rng = np.random.default_rng(seed)
    P, Y, t = Variable("P", 3, symmetric=True), Variable("Y", 2, 3), Variable("t", 1)
    A, B = rng.integers(-9, 9, (3, 3)) * Fraction(1, 7) - 9 * np.eye(3, dtype=int), rng.standard_normal((3, 2))
    problem = Problem()
    problem.positive("first", block([[P - A @ Y.T @ B.T, None], [Y, t * np.eye(2, dtype=int)]]))
    problem.negative("second", he(A @ P + B @ Y) - t * rng.standard_normal((3, 3)))
    return problem


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_compiled_matrices_are_the_values_of_the_expressions(seed: int) -> None:
    problem = random_problem(seed)
    compiled = CompiledProblem.of(problem)
    rng = np.random.default_rng(seed)
    point = rng.standard_normal(len(compiled.layout.kept))
    values = compiled.values(point)
    coefficients, offset = compiled.matrix()
    expected = []
    for constraint in problem.constraints:
        matrix = constraint.expression.at(values).astype(float)
        symmetric = (matrix + matrix.T) / 2
        size = len(symmetric)
        expected += [symmetric[i, j] * (1 if i == j else 2**0.5) for j in range(size) for i in range(j + 1)]
    np.testing.assert_allclose(coefficients @ point + offset, expected, atol=1e-12, rtol=1e-12)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_integer_check_agrees_with_rational_evaluation_of_the_expressions(seed: int) -> None:
    problem = random_problem(seed)
    compiled = CompiledProblem.of(problem)
    rng = np.random.default_rng(seed)
    verdicts = []
    for spread, sign in ((0.0, 1.0), (0.0, -1.0), (0.1, 1.0), (1.0, 1.0), (10.0, 1.0)):
        values = {v: spread * rng.standard_normal((v.rows, v.cols)) for v in problem.variables}
        for v in problem.variables:
            if v.symmetric:
                values[v] = values[v] + values[v].T + sign * 5 * np.eye(v.rows)
            elif v.size == 1:
                values[v] = values[v] + sign
        point = np.concatenate([_packed(v, values[v]) for v in problem.variables])
        full = replace(compiled, layout=replace(compiled.layout, kept=np.arange(point.size)))
        verdicts.append(full.holds_exactly(point))
        assert verdicts[-1] == problem.holds_exactly(values)
    assert verdicts[:2] == [True, False]


def _packed(variable: Variable, value: np.ndarray) -> np.ndarray:
    flat = np.zeros(variable.size)
    flat[variable.index().ravel()] = value.ravel()
    return flat


def test_dependent_unknowns_are_dropped_without_loss() -> None:
    T, S, P = Variable("T", 2, symmetric=True), Variable("S", 2, symmetric=True), Variable("P", 2, symmetric=True)
    problem = Problem()
    problem.positive("P", P)
    problem.positive("sum", P + T + S)
    problem.positive("other", P - T - S)
    compiled = CompiledProblem.of(problem)
    assert compiled.layout.unknowns == 9
    assert len(compiled.layout.kept) == 6
    coefficients, _ = compiled.matrix()
    assert np.linalg.matrix_rank(coefficients.toarray()) == 6


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_kept_columns_are_a_basis_and_no_basis_has_fewer_entries(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, rank = int(rng.integers(2, 7)), int(rng.integers(1, 5))
    rows = int(rng.integers(3, 40))
    matrix = rng.integers(-3, 4, (rows, rank)) @ rng.integers(-1, 2, (rank, count)).astype(float)
    kept = independent_columns(sparse.csr_matrix(matrix))
    true_rank = np.linalg.matrix_rank(matrix)
    assert len(kept) == true_rank
    bases = [
        subset
        for subset in map(list, combinations(range(count), true_rank))
        if np.linalg.matrix_rank(matrix[:, subset]) == true_rank
    ]
    assert kept.tolist() in bases
    assert np.count_nonzero(matrix[:, kept]) == min(np.count_nonzero(matrix[:, subset]) for subset in bases)


def test_when_there_are_more_columns_than_are_taken_at_once_expect_every_dependence_found() -> None:
    rng = np.random.default_rng(0)
    independent = sparse.random(2000, 150, density=0.02, random_state=0) + sparse.eye(2000, 150)
    repeated = independent @ sparse.csr_matrix(rng.integers(-2, 3, (150, 60)))
    assert independent_columns(sparse.hstack([repeated, independent]).tocsr()).tolist() == list(range(60, 210))


@pytest.mark.parametrize("step", [1.0, 0.1, 2.0**-70])
def test_when_integers_are_long_or_short_expect_the_same_exact_sums(step: float) -> None:
    compiled = compile_family(family, {"a": 0.0, "b": 0.0})
    assert compiled is not None
    member = compiled.at({"a": 3.0 * step, "b": -7.0 * step})
    for point in (np.array([1.0, 0.5, 3.0]), np.array([1.0 / 3.0, 2.0**-60, 1e6])):
        long = replace(member, coefficients=member.coefficients.astype(object))
        assert member.first_violated(point) == long.first_violated(point)
        exact = {v: to_rational(x) for v, x in member.values(point).items()}
        a, b = Fraction(3.0 * step), Fraction(-7.0 * step)
        A = np.array([[a - 1, 2 * b], [Fraction(1, 2), -3 - a]], dtype=object)
        (P,) = exact.values()
        holds = is_positive_definite(P) and is_positive_definite(-(A @ P + P @ A.T))
        assert member.holds_exactly(point) == holds


def family(parameters: Mapping[str, float]) -> Problem:
    a, b = parameters["a"], parameters["b"]
    return lyapunov(np.array([[-1.0 + a, 2.0 * b], [0.5, -3.0 - a]]))


@given(st.floats(-8, 8), st.floats(-20, 20))
@settings(max_examples=25, deadline=None)
def test_a_family_gives_the_problem_of_every_parameter_point_exactly(a: float, b: float) -> None:
    compiled = compile_family(family, {"a": 0.0, "b": 0.0})
    assert compiled is not None
    member, direct = compiled.at({"a": a, "b": b}), CompiledProblem.of(family({"a": a, "b": b}))
    # The vertices -1 + a are rounded by `family` itself: compare in double.
    for one, other in zip(member.matrix(), direct.matrix(), strict=True):
        difference = one - other
        assert np.max(np.abs(difference.toarray() if hasattr(difference, "toarray") else difference)) < 1e-14 * 30


def test_data_that_are_not_affine_in_a_parameter_have_no_family() -> None:
    assert compile_family(lambda p: lyapunov(np.array([[-1.0 - p["a"] ** 2]])), {"a": 1.0}) is None


@given(st.lists(st.integers(-3, 3), min_size=10, max_size=10), st.sampled_from([0.0, 0.5, -3.0]))
@example([0, 351, 530, -351, 615, -530, 0, 0, 0, 0], 0.0)  # zero at (0,0), (1,0), (0,1), (7/4,7/2) and (13/4,15/4)
@settings(max_examples=30, deadline=None)
def test_a_family_is_accepted_if_and_only_if_its_polynomials_are_affine(coefficients: list[int], base: float) -> None:
    """All polynomials of degree three at most, in powers of a and b that double arithmetic does without rounding."""
    powers = [(i, j) for total in range(4) for i, j in product(range(total + 1), repeat=2) if i + j == total]

    def build(point: Mapping[str, float]) -> Problem:
        value = sum(c * point["a"] ** i * point["b"] ** j for c, (i, j) in zip(coefficients, powers, strict=True))
        return lyapunov(np.array([[-1.0 + value]]))

    found = compile_family(build, {"a": base, "b": 2.0 * base})
    assert (found is not None) == (not any(coefficients[3:]))


@given(SEEDS, st.integers(2, 6))
@settings(max_examples=25, deadline=None)
def test_one_solution_for_several_points_proves_every_point_of_their_hull(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    compiled = compile_family(family, {"a": 0.0, "b": 0.0})
    assert compiled is not None
    corners = [dict(zip("ab", rng.uniform(-1.5, 1.5, 2).tolist(), strict=True)) for _ in range(count)]
    decision = decide(common_problem(compiled, corners))
    assume(decision.feasible)
    (P,) = decision.values.values()
    for weights in rng.dirichlet(np.ones(count), 20):
        inside = {name: float(weights @ [corner[name] for corner in corners]) for name in "ab"}
        a, b = inside["a"], inside["b"]
        A = np.array([[-1.0 + a, 2.0 * b], [0.5, -3.0 - a]])
        assert np.linalg.eigvalsh(P)[0] > 0.0 > np.linalg.eigvalsh(A @ P + P @ A.T)[-1]
        assert compiled.at(inside).holds_exactly(decision.point)


def test_points_that_are_feasible_one_by_one_need_not_have_a_common_solution() -> None:
    compiled = compile_family(lambda p: lyapunov(np.array([[-0.1, p["a"]], [-p["b"], -0.1]])), {"a": 1.0, "b": 1.0})
    assert compiled is not None
    ends = [{"a": 9.0, "b": 0.1}, {"a": 0.1, "b": 9.0}]
    assert all(decide(compiled.at(end)).feasible for end in ends)
    assert not decide(common_problem(compiled, ends)).feasible


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_lyapunov_inequality_is_decided_as_the_eigenvalues_say(seed: int) -> None:
    A = np.random.default_rng(seed).standard_normal((3, 3))
    abscissa = np.linalg.eigvals(A).real.max()
    assume(abs(abscissa) >= 0.02)
    decision = decide(CompiledProblem.of(lyapunov(A)))
    expected = Outcome.VERIFIED if abscissa < 0 else Outcome.INFEASIBLE_NUMERICALLY
    assert decision.outcome is expected
    if decision.feasible:
        (P,) = decision.values.values()
        assert np.linalg.eigvalsh(P)[0] > 0 > np.linalg.eigvalsh(A @ P + P @ A.T)[-1]
    else:
        assert decision.excluded_norm > 1e3


def test_the_margin_reached_is_that_of_the_point_and_no_larger_than_the_largest() -> None:
    problem = lyapunov(np.array([[-1.0, 2.0, 0.0], [0.0, -3.0, 1.0], [0.5, 0.0, -2.0]]))
    decision = decide(CompiledProblem.of(problem))
    eigenvalues = [
        np.linalg.eigvalsh((M + M.T) / 2)
        for M in (c.expression.at(decision.values).astype(float) for c in problem.constraints)
    ]
    expected = min(e[0] for e in eigenvalues) / np.mean(np.concatenate(eigenvalues))
    assert decision.margin == pytest.approx(expected, rel=1e-12)
    assert 0.0 < decision.margin <= largest_margin(problem).margin * (1 + 1e-6)


def test_inequalities_with_constants_are_refused() -> None:
    P = Variable("P", 2, symmetric=True)
    problem = Problem()
    problem.positive("P > I", P - np.eye(2))
    with pytest.raises(ValueError, match="constant terms"):
        decide(CompiledProblem.of(problem))


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20))
@example([5e-324])
@example([5e-324, -2.5e-308, 1e-322])
@example([np.finfo(float).max, -np.finfo(float).max, 5e-324])
@example([0.0, -0.0])
def test_rounding_moves_a_point_by_less_than_its_unit_whatever_its_size(entries: list[float]) -> None:
    with np.errstate(invalid="raise", divide="raise", over="raise"):
        moved = rounded(np.array(entries))
    _, exponent = math.frexp(max(map(abs, entries)))
    unit = Fraction(2) ** (exponent - 40)
    nearest = unit / 2 if exponent < 1024 else unit  # beyond the largest doubles there is nothing to round to
    for new, old in zip(moved.tolist(), entries, strict=True):
        assert (Fraction(new) / unit).denominator == 1
        assert abs(Fraction(new) - Fraction(old)) <= nearest


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20), st.integers(-900, 900))
def test_rounding_does_not_depend_on_the_unit_of_a_point(entries: list[float], exponent: int) -> None:
    point = np.array(entries)
    assume(np.all((point == 0.0) | (np.abs(point) > 1e-30)))  # no subnormal ones in the other unit
    np.testing.assert_array_equal(rounded(np.ldexp(point, exponent)), np.ldexp(rounded(point), exponent))
