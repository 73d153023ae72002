"""Two back ends and a third solver against problems whose verdict and margin are known by construction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from quasilpv.arrays import FloatArray
from quasilpv.lmi import Expression, Outcome, Problem, Variable, constant, he, largest_margin, scaling_report, zeros
from quasilpv.lmi.backends import BackendName

SOLVERS: tuple[tuple[BackendName, str | None], ...] = (("clarabel", None), ("cvxpy", "CLARABEL"), ("cvxpy", "CVXOPT"))
BAND = 0.01


@dataclass(frozen=True)
class Posed:
    """A problem and what is true of it."""

    problem: Problem
    feasible: bool


def decay_problem(rng: np.random.Generator) -> Posed:
    """``A'P + P A + 2 alpha P < 0, P > 0``: feasible if and only if no eigenvalue of A has real part >= -alpha."""
    size = int(rng.integers(2, 5))
    A = rng.normal(size=(size, size))
    edge = -float(np.linalg.eigvals(A).real.max())
    off = float(rng.uniform(BAND, 0.5)) * np.linalg.norm(A, 2)
    feasible = bool(rng.integers(2))
    P = Variable("P", size, symmetric=True)
    problem = Problem()
    problem.positive("P", P)
    problem.negative("decay", he(A.T @ P) + P * (2.0 * (edge - off if feasible else edge + off)))
    problem.minimise(trace_of(P, size))
    return Posed(problem, feasible)


def affine_problem(rng: np.random.Generator) -> Posed:
    """``F_0 + sum_i x_i F_i > 0`` with a planted point of known margin, or with a planted separating Z > 0."""
    size, unknowns = int(rng.integers(3, 6)), int(rng.integers(2, 5))
    F = symmetric(rng.normal(size=(unknowns, size, size)))
    feasible = bool(rng.integers(2))
    off = float(rng.uniform(BAND, 0.5))
    if feasible:
        point = rng.normal(size=unknowns)
        noise = rng.normal(size=(size, size))
        F0 = off * np.eye(size) + noise @ noise.T - np.tensordot(point, F, axes=1)
    else:
        root = rng.normal(size=(size, size))
        Z = root @ root.T + 0.1 * np.eye(size)
        F -= (np.tensordot(F, Z, axes=2) / np.sum(Z * Z))[:, None, None] * Z  # now <Z, F_i> = 0 for i > 0
        F0 = symmetric(rng.normal(size=(1, size, size)))[0]
        F0 -= (np.sum(F0 * Z) + off * np.trace(Z)) / np.sum(Z * Z) * Z  # and <Z, F_0> = -off trace Z
    x = [Variable(f"x{i}", 1) for i in range(unknowns)]
    problem = Problem()
    problem.positive("F", sum((xi * Fi for xi, Fi in zip(x, F, strict=True)), constant(F0)))
    problem.positive("ball", np.eye(unknowns) * 20.0 - sum_of(x, unknowns))
    problem.positive("antipodal ball", np.eye(unknowns) * 20.0 + sum_of(x, unknowns))
    problem.minimise(sum((xi * c for xi, c in zip(x, rng.normal(size=unknowns), strict=True)), constant([[0.0]])))
    return Posed(problem, feasible)


def symmetric(matrices: FloatArray) -> FloatArray:
    return np.asarray(matrices + np.swapaxes(matrices, -1, -2)) / 2.0


def trace_of(P: Variable, size: int) -> Expression:
    unit = np.eye(size)
    return sum((unit[[i]] @ P @ unit[[i]].T for i in range(size)), zeros(1, 1))


def sum_of(x: list[Variable], size: int) -> Expression:
    """diag(x_1, ..., x_m)."""
    unit = np.eye(size)
    return sum((xi * np.outer(e, e) for xi, e in zip(x, unit, strict=True)), constant(np.zeros((size, size))))


def posed(seed: int) -> Posed:
    rng = np.random.default_rng(seed)
    return (decay_problem if seed % 2 else affine_problem)(rng)


def assert_every_solver_agrees(seed: int) -> None:
    case = posed(seed)
    margins = []
    for backend, solver in SOLVERS:
        found = largest_margin(case.problem, backend=backend, solver=solver)
        wanted = Outcome.VERIFIED if case.feasible else Outcome.INFEASIBLE_NUMERICALLY
        assert found.outcome is wanted, (seed, backend, solver, found)
        assert case.problem.holds_exactly(found.values) if case.feasible else not found.values
        margins.append(found.margin)
    assert margins == pytest.approx([margins[0]] * len(SOLVERS), rel=2e-2, abs=1e-6), seed


def assert_every_solver_finds_the_same_optimum(seed: int) -> None:
    case = posed(seed)
    if seed % 2:  # without a floor under P the least trace is zero
        P = case.problem.variables[0]
        case.problem.positive("P > I", P - np.eye(P.rows))
    optima = [case.problem.solve(backend=backend, solver=solver) for backend, solver in SOLVERS]
    if not case.feasible:
        assert all(not optimum.verified for optimum in optima), seed
        return
    objectives = [optimum.objective for optimum in optima]
    assert objectives == pytest.approx([objectives[0]] * len(SOLVERS), rel=1e-5, abs=1e-5), seed


@pytest.mark.parametrize("seed", range(20))
def test_when_a_problem_is_posed_expect_every_solver_to_give_the_verdict_planted_in_it(seed: int) -> None:
    assert_every_solver_agrees(seed)
    assert_every_solver_finds_the_same_optimum(seed)


@pytest.mark.full
@pytest.mark.parametrize("seed", range(20, 220))
def test_when_many_problems_are_posed_expect_every_solver_to_give_the_verdict_planted_in_them(seed: int) -> None:
    assert_every_solver_agrees(seed)
    assert_every_solver_finds_the_same_optimum(seed)


@pytest.mark.parametrize("off", [1e-1, 1e-3, -1e-3, -1e-1])
def test_when_the_data_pass_the_edge_expect_a_margin_that_passes_through_zero_in_proportion(off: float) -> None:
    x = Variable("x", 1)
    problem = Problem()
    problem.positive("above", x - np.array([[1.0]]))
    problem.positive("below", np.array([[1.0 + off]]) - x)
    found = largest_margin(problem)
    # Infeasible: t = off / 2 in the middle, s = 1. Feasible: both equal to 1 at s = 2 / off, of three numbers.
    assert found.margin == pytest.approx(off / 2.0 if off < 0 else 3.0 / (2.0 + 2.0 / off), rel=1e-3)
    assert set(found.tight) == {"above", "below"}


def test_when_the_edge_is_within_the_accuracy_of_the_solver_expect_no_verdict() -> None:
    x = Variable("x", 1)
    for off in (1e-6, -1e-6):
        problem = Problem()
        problem.positive("above", x - np.array([[1.0]]))
        problem.positive("below", np.array([[1.0 + off]]) - x)
        found = largest_margin(problem)
        assert found.outcome is Outcome.UNKNOWN
        assert abs(found.margin) < 1e-5


def test_when_some_inequalities_disagree_expect_them_named_and_the_bystander_not() -> None:
    x, y = Variable("x", 1), Variable("y", 1)
    problem = Problem()
    problem.positive("x > 1", x - np.array([[1.0]]))
    problem.positive("bystander", y + np.array([[5.0]]))
    problem.negative("x < -1", x + np.array([[1.0]]))
    found = largest_margin(problem)
    assert found.outcome is Outcome.INFEASIBLE_NUMERICALLY
    assert set(found.tight) == {"x > 1", "x < -1"}


def test_when_the_answer_of_the_margin_program_is_spoilt_expect_the_exact_check_to_say_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = posed(0).problem if posed(0).feasible else posed(2).problem
    monkeypatch.setattr(Problem, "holds_exactly", lambda self, values: False)
    assert largest_margin(problem).outcome is Outcome.SOLVER_ONLY


def test_when_a_problem_is_reported_expect_the_magnitudes_of_its_data_and_solution() -> None:
    X, x = Variable("X", 2, symmetric=True), Variable("x", 1)
    problem = Problem()
    problem.positive("wide", X * 1e3 - np.diag([1e-3, 7.0]))
    problem.positive("narrow", x + np.array([[2.0]]))
    report = scaling_report(problem, {X: np.array([[4.0, 0.0], [0.0, 0.5]]), x: np.array([[3.0]])})
    assert (report.constraints["wide"].smallest, report.constraints["wide"].largest) == (1e-3, 1e3)
    assert report.worst_constraint == "wide"
    assert report.constraints["wide"].decades == pytest.approx(6.0)
    assert report.constraints["narrow"].decades == pytest.approx(math.log10(2.0))
    assert (report.variables["X"].smallest, report.variables["X"].largest) == (0.5, 4.0)


def test_when_there_is_no_such_back_end_or_solver_expect_an_error_that_lists_those_there_are() -> None:
    problem = posed(0).problem
    with pytest.raises(ValueError, match=r"sedumi.*clarabel, cvxpy"):
        problem.solve(backend="sedumi")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"NOSUCH.*CLARABEL"):
        problem.solve(backend="cvxpy", solver="NOSUCH")
    with pytest.raises(ValueError, match=r"solver: got 'SCS', expected none"):
        problem.solve(solver="SCS")


def test_when_an_interior_point_is_asked_of_cvxpy_expect_one_that_is_proved() -> None:
    case = next(case for case in map(posed, range(1, 40, 2)) if case.feasible)
    P = case.problem.variables[0]
    case.problem.positive("P > I", P - np.eye(P.rows))
    for backend, solver in SOLVERS:
        assert case.problem.solve_inside(backend=backend, solver=solver).verified
