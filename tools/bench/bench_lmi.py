"""Conditions by direct assembly for Clarabel, beside the same inequalities written in cvxpy, and large ones alone."""

# cvxpy is only partly typed.
# mypy: disable-error-code="attr-defined, no-untyped-call"

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from time import process_time_ns
from typing import Any
from unittest.mock import patch

import cvxpy as cp
import numpy as np
from bench_map import measure_map
from bench_report import DisagreementError, Report, Row, main, row

from quasilpv.conditions.tracking.sampled_chains import (
    FEEDBACK_DISK,
    OBSERVER_DISK,
    ChainGains,
    disk_of,
    feedback_chain,
    feedback_gains,
    observer_chain,
    observer_gains,
)
from quasilpv.lmi import Outcome, Problem, Solution, clarabel_backend
from quasilpv.studies import Question, Sweep

SAMPLE_PERIOD_S = 1e-3
LARGEST_RELATIVE_DIFFERENCE = 1e-4
CVXPY = "cvxpy with Clarabel"

Gains = Callable[[float, float], ChainGains]


@dataclass(frozen=True)
class Case:
    """One condition at one bandwidth, stated twice.

    Attributes:
        name: of the rows.
        gains: the condition of the library.
        naive: the same semidefinite program for cvxpy.
        bandwidth: rad/s.
    """

    name: str
    gains: Gains
    naive: Callable[[float], cp.Problem]
    bandwidth: float


def naive_feedback(bandwidth: float) -> cp.Problem:
    """The inequalities of `feedback_gains`, as its docstring prints them."""
    A, B = (np.array(matrix, dtype=float) for matrix in feedback_chain(bandwidth * SAMPLE_PERIOD_S))
    centre, radius = map(float, disk_of(bandwidth, SAMPLE_PERIOD_S, FEEDBACK_DISK))
    P, Y = cp.Variable((3, 3), symmetric=True), cp.Variable((1, 3))
    X = A @ P + B @ Y
    disk = cp.bmat([[radius * P, (X - centre * P).T], [X - centre * P, radius * P]])
    covariance = cp.bmat([[P, X, B], [X.T, P, np.zeros((3, 1))], [B.T, np.zeros((1, 3)), np.ones((1, 1))]])
    return cp.Problem(cp.Minimize(P[0, 0]), [disk >> 0, covariance >> 0])


def naive_observer(bandwidth: float) -> cp.Problem:
    """The inequalities of `observer_gains`, as its docstring prints them."""
    A, G, C = (np.array(matrix, dtype=float) for matrix in observer_chain(bandwidth * SAMPLE_PERIOD_S))
    centre, radius = map(float, disk_of(bandwidth, SAMPLE_PERIOD_S, OBSERVER_DISK))
    Q, W, N = cp.Variable((4, 4), symmetric=True), cp.Variable((4, 1)), cp.Variable((2, 2), symmetric=True)
    X = Q @ A - W @ C
    c3 = np.array([[0.0, 0.0, 1.0, 0.0]])
    inputs = cp.hstack([W, Q @ G])
    disk = cp.bmat([[radius * Q, (X - centre * Q).T], [X - centre * Q, radius * Q]])
    gramian = cp.bmat([[Q, X], [X.T, Q - c3.T @ c3]])
    variance = cp.bmat([[N, inputs.T], [inputs, Q]])
    return cp.Problem(cp.Minimize(cp.trace(N)), [disk >> 0, gramian >> 0, variance >> 0])


CASES = (
    Case("feedback chain, 60 rad/s", feedback_gains, naive_feedback, 60.0),
    Case("feedback chain, 200 rad/s", feedback_gains, naive_feedback, 200.0),
    Case("observer chain, 500 rad/s", observer_gains, naive_observer, 500.0),
    Case("observer chain, 1500 rad/s", observer_gains, naive_observer, 1500.0),
)


@contextmanager
def stated_problems() -> Iterator[list[Problem]]:
    """Collect the problems that conditions state instead of solving them."""
    problems: list[Problem] = []

    def collect(problem: Problem) -> Solution:
        problems.append(problem)
        return Solution(Outcome.NOT_RUN)

    with patch.object(Problem, "solve_inside", collect):
        yield problems


def state_directly(case: Case) -> Problem:
    """The condition in the library's vocabulary, its constants exact rationals."""
    with stated_problems() as problems:
        case.gains(case.bandwidth, SAMPLE_PERIOD_S)
    return problems[0]


def solve_directly(problem: Problem) -> float:
    """Assemble for Clarabel and solve once; returns the optimum, NaN without one."""
    raw = clarabel_backend.solve(problem.constraints, problem.objective, problem.variables)
    if not raw.values or problem.objective is None:
        return math.nan
    return float(problem.objective.at(raw.values)[0, 0])


def solve_naively(problem: cp.Problem) -> float:
    """Let cvxpy canonicalise and solve with Clarabel's own default settings; returns the optimum."""
    problem.solve(solver=cp.CLARABEL, max_threads=1)
    return math.nan if problem.value is None else float(problem.value)


@dataclass(frozen=True)
class Way:
    """One way to solve a case: statement and solution are timed apart."""

    state: Callable[[], Any]
    solve: Callable[[Any], float]


@dataclass(frozen=True)
class Spent:
    """CPU times of the repetitions of one way, ms.

    Attributes:
        solving: from the stated problem on.
        whole: with its statement.
    """

    solving: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)


def spent_ms(ways: Sequence[Way], repetitions: int) -> list[Spent]:
    """CPU times of each way. They take turns, so that whatever else the machine does meets them all."""
    spent = [Spent() for _ in ways]
    for _ in range(repetitions):
        for way, kept in zip(ways, spent, strict=True):
            start = process_time_ns()
            stated = way.state()
            middle = process_time_ns()
            way.solve(stated)
            end = process_time_ns()
            kept.solving.append((end - middle) * 1e-6)
            kept.whole.append((end - start) * 1e-6)
    return spent


def require_agreement(name: str, direct: Way, naive: Way) -> str:
    """Say how far the two optima are apart.

    Raises:
        DisagreementError: too far for the same problem.
    """
    ours, theirs = (way.solve(way.state()) for way in (direct, naive))
    difference = abs(ours - theirs) / abs(theirs)
    text = f"{name}: optimum {ours:.8g}, {CVXPY} {theirs:.8g}, relative difference {difference:.1e}"
    if not difference <= LARGEST_RELATIVE_DIFFERENCE:
        raise DisagreementError(f"{text}: not the same problem")
    return text


LARGE = (
    ("I.2 of arm3, 4096 vertices", partial(Question, "arm3", "I.2", "ts")),
    ("II.8 of ex-I.1, tau -> 0", partial(Question, "ex-I.1", "II.8")),
)
"""Questions that are timed alone: cvxpy would take minutes to compile them."""


def measure_large(questions: Sequence[tuple[str, Callable[[], Question]]]) -> tuple[list[Row], list[str]]:
    """Time from the equations of the system to the certified answer."""
    rows, notes = [], []
    for name, ask in questions:
        start = process_time_ns()
        answer = Sweep(ask(), ()).at({})
        rows.append(row(f"{name}: stated, decided and certified", (process_time_ns() - start) * 1e-9, "s"))
        known = "certified" if answer.certified else "not certified"
        notes.append(f"{name}: {answer.verdict}, {known}; {answer.unknowns} unknowns, {answer.rows} rows as solved")
    return rows, notes


def measure(quick: bool) -> Report:
    """Time everything; what is compared is first found to be the same problem."""
    rows, notes = measure_chains(quick=quick)
    for more_rows, more_notes in (measure_map(quick=quick), measure_large(LARGE[:1] if quick else LARGE)):
        rows += more_rows
        notes += more_notes
    packages = ("clarabel", "cvxpy", "scs", "cvxopt", "sdpa-python", "numpy", "scipy")
    return Report(rows, notes, packages, foreign=True)


def measure_chains(*, quick: bool) -> tuple[list[Row], list[str]]:
    """Check that both ways find the same optimum, then time them."""
    rows: list[Row] = []
    notes = ["CPU time, one solve each, same solver and settings, one thread; statement: from the chain to expressions"]
    for case in CASES:
        direct = Way(partial(state_directly, case), solve_directly)
        naive = Way(partial(case.naive, case.bandwidth), solve_naively)
        notes.append(require_agreement(case.name, direct, naive))
        ours, theirs = spent_ms([direct, naive], repetitions=1 if quick else 30)
        rows.append(row(f"{case.name}: assembly and solve", ours.solving, "ms", (CVXPY, theirs.solving)))
        rows.append(row(f"{case.name}: with its statement", ours.whole, "ms", (CVXPY, theirs.whole)))
    return rows, notes


if __name__ == "__main__":
    main("lmi", "Conditions: direct assembly for Clarabel beside cvxpy and other solvers.", measure)
