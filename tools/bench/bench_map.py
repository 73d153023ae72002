"""Theorem II.6 at the points of a map of Example I.1: a data update and Clarabel, beside cvxpy and other solvers.

The inequalities are written for cvxpy from the formulas, with nothing of the library's vocabulary: if the verdicts
agree, both state the same problem.
"""

# cvxpy is only partly typed.
# mypy: disable-error-code="attr-defined, no-untyped-call"

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from statistics import fmean
from time import process_time_ns
from typing import Any, TypeAlias
from unittest.mock import patch

import cvxpy as cp
import numpy as np
from bench_report import DisagreementError, Row, row
from bench_solvers import SOLVERS, Conic, decide_with

from quasilpv.lmi.compiled import CompiledFamily, CompiledProblem, compile_family
from quasilpv.studies import Question, Sweep, Verdict
from quasilpv.studies.checkpoint import Forgetful
from quasilpv.studies.engines import in_processes
from quasilpv.studies.region import Axis, Map, sweep_of

QUESTION = Question("ex-I.1", "II.6")
NAME = "II.6 of ex-I.1, grid point"
AREAS = "II.6 of ex-I.1, map by areas, per grid point"
NAIVE, PARAMETRISED = "cvxpy, built anew", "cvxpy, compiled once (DPP)"
CLARABEL = {"solver": cp.CLARABEL, "max_threads": 1, "direct_solve_method": "faer"}
"""As `quasilpv.lmi.feasibility` sets it; everything else is Clarabel's default on all sides."""

Point: TypeAlias = Mapping[str, float]
Ways: TypeAlias = dict[str, Callable[[Point], Verdict]]


def inequalities(a: Any, b: Any) -> cp.Problem:
    """Theorem II.6 for Example I.1 on the vertices (II.10), centred at z = 0, slack T and S.

    ``He[A_i L_j + B_i F_j, A_i R_j; P E_i' - L_j, -R_j] + T_p(i) + S_p(j) - (1/r) sum_p (T_p + S_p)`` summed over the
    weights of i and j; r = 3 premises, N = 2 r = 6 vertices ``X_0 + r z_p X_p`` at both bounds of every premise. The
    sum by Tuan's lemma, every inequality at least I (they are homogeneous).

    Args:
        a, b: numbers or parameters of cvxpy.
    """
    r, n, upper = 3, 2, (1.0, 1.0, 2.0)
    zero = np.zeros((2, 2))
    E = _vertices(np.array([[1.0, 1.0], [-1.0, 0.0]]), (np.diag([0.0, 1.0]), zero, zero), upper)
    A1, A2 = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0, -1.0], [0.0, 0.0]])
    A = _vertices(np.array([[0.0, 0.0], [-1.5, -3.0]]), (A1, A2, b * np.diag([0.0, 1.0])), upper)
    B1 = a * np.array([[0.0], [1.0]])
    B = _vertices(np.array([[1.0], [-2.0]]), (B1, np.array([[1.0], [0.0]]), np.zeros((2, 1))), upper)
    count = len(A)
    P = cp.Variable((n, n), symmetric=True)
    L, R = ([cp.Variable((n, n)) for _ in range(count)] for _ in range(2))
    F = [cp.Variable((1, n)) for _ in range(count)]
    T, S = ([cp.Variable((2 * n, 2 * n), symmetric=True) for _ in range(r)] for _ in range(2))
    mean = sum(T + S) / r

    def entry(i: int, j: int) -> Any:
        half = cp.bmat([[A[i] @ L[j] + B[i] @ F[j], A[i] @ R[j]], [P @ E[i].T - L[j], -R[j]]])
        return half + half.T + T[i // 2] + S[j // 2] - mean

    sums = [entry(i, i) for i in range(count)]
    sums += [
        2 / (count - 1) * entry(i, i) + entry(i, j) + entry(j, i) for i, j in product(range(count), repeat=2) if i != j
    ]
    return cp.Problem(cp.Minimize(0), [P >> np.eye(n), *(X << -np.eye(2 * n) for X in sums)])


def _vertices(constant: Any, slopes: Sequence[Any], upper: Sequence[float]) -> list[Any]:
    """Vertices of ``X_0 + sum_p z_p X_p``, 0 <= z_p <= upper_p, one block per premise, centred at 0."""
    return [constant + len(upper) * z * X for X, high in zip(slopes, upper, strict=True) for z in (0.0, high)]


def solve_with_cvxpy(problem: cp.Problem) -> Verdict:
    """What Clarabel says of the problem through cvxpy, an inaccurate answer taken for an answer."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about inaccurate answers
        try:
            problem.solve(**CLARABEL)
        except cp.SolverError:
            return Verdict.UNKNOWN
    if problem.status in {cp.OPTIMAL, cp.OPTIMAL_INACCURATE}:
        return Verdict.FEASIBLE
    return Verdict.INFEASIBLE if problem.status in {cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE} else Verdict.UNKNOWN


def naive(point: Point) -> Verdict:
    """Build, compile and solve one problem."""
    return solve_with_cvxpy(inequalities(point["a"], point["b"]))


class Parametrised:
    """The problem compiled once, a and b parameters of cvxpy (disciplined parametrised programming)."""

    def __init__(self) -> None:
        """Build, and compile by solving once."""
        self._a, self._b = cp.Parameter(), cp.Parameter()
        self._problem = inequalities(self._a, self._b)
        self({"a": 1.0, "b": 1.0})

    def __call__(self, point: Point) -> Verdict:
        """Set the parameters and solve."""
        self._a.value, self._b.value = point["a"], point["b"]
        return solve_with_cvxpy(self._problem)


def uncertified(sweep: Sweep, point: Point) -> Verdict:
    """What the sweep would say if it believed the solver."""
    with patch.object(CompiledProblem, "holds_exactly", lambda self, x: True):
        return sweep.at(point).verdict


def with_solver(family: CompiledFamily, solver: Conic, point: Point) -> Verdict:
    """The sweep's own data update, and another solver."""
    return decide_with(solver, family.at(point))


def direct_peers() -> tuple[Ways, list[str]]:
    """The other solvers there are, set up for the map, and a note on each that is missing."""
    family = compile_family(lambda point: QUESTION.at(point).statement().problem, {"a": 1.0, "b": 1.0})
    if family is None:
        raise DisagreementError(f"{NAME}: the data are not affine in a and b")
    peers: Ways = {}
    missing = []
    for name, load in SOLVERS.items():
        try:
            peers[f"{name}, direct assembly"] = partial(with_solver, family, load(family.layout))
        except ImportError as error:
            missing.append(f"{name} was not measured: it is not available here ({error})")
    return peers, missing


@dataclass(frozen=True)
class Timed:
    """One way over the whole grid.

    Attributes:
        milliseconds: CPU time per point, mean over the grid.
        verdicts: by point.
    """

    milliseconds: float
    verdicts: tuple[Verdict, ...]


def over_grid(ways: Ways, points: Sequence[Point]) -> dict[str, Timed]:
    """Time all ways; at every point they take turns, so that whatever else the machine does meets them all."""
    verdicts: dict[str, list[Verdict]] = {name: [] for name in ways}
    spent: dict[str, list[int]] = {name: [] for name in ways}
    for point in points:
        for name, way in ways.items():
            start = process_time_ns()
            verdicts[name].append(way(point))
            spent[name].append(process_time_ns() - start)
    return {name: Timed(fmean(spent[name]) * 1e-6, tuple(verdicts[name])) for name in ways}


def measure_map(*, quick: bool) -> tuple[list[Row], list[str]]:
    """Rows and notes of the map.

    Raises:
        DisagreementError: the statements with Clarabel differ in a verdict, so they are not the same problem.
    """
    size = (2, 3) if quick else (9, 9)
    grid = product(np.linspace(-8.0, 8.0, size[0]).tolist(), np.linspace(-20.0, 20.0, size[1]).tolist())
    points: list[Point] = [{"a": a, "b": b} for a, b in grid]
    start = process_time_ns()
    sweep = Sweep(QUESTION, ("a", "b"))
    compiled = process_time_ns()
    parametrised = Parametrised()
    once = (compiled - start) * 1e-6, (process_time_ns() - compiled) * 1e-6
    ours: Ways = {"certified": lambda point: sweep.at(point).verdict, "solver only": partial(uncertified, sweep)}
    cvxpy: Ways = {NAIVE: naive, PARAMETRISED: parametrised}
    peers, missing = direct_peers()
    notes = [f"{NAME}: {len(points)} points, a in [-8, 8], b in [-20, 20]; Clarabel with the same options on all sides"]
    notes += missing
    timed = over_grid(ours | cvxpy | peers, points)
    notes += agreement(timed, cvxpy)
    rows = [
        row(f"{NAME}: {way}, beside {name}", timed[way].milliseconds, "ms", (name, timed[name].milliseconds))
        for way, others in (("certified", cvxpy | peers), ("solver only", cvxpy))
        for name in others
    ]
    rows.append(row(f"{NAME}s: compiled, once", once[0], "ms", (PARAMETRISED, once[1])))
    areas, note = measure_areas(9 if quick else 33)
    rows.append(row(f"{AREAS}, beside {PARAMETRISED}", areas, "ms", (PARAMETRISED, timed[PARAMETRISED].milliseconds)))
    return rows, [*notes, note]


def measure_areas(count: int) -> tuple[float, str]:
    """CPU time of a map by areas, ms per point of the grid whose resolution it has, compiling included; and a note.

    Args:
        count: points along each axis.
    """
    sweep_of.cache_clear()
    axes = Axis("a", -8.0, 8.0, count), Axis("b", -20.0, 20.0, count)
    start = process_time_ns()
    areas = Map(QUESTION, *axes, solver=in_processes(1), memory=Forgetful(), progress=lambda done, known: None).areas()
    spent = (process_time_ns() - start) * 1e-6 / count**2
    if areas.areas is None:
        raise DisagreementError(f"{AREAS}: no areas")
    proved, undecided = areas.areas.proved_share, areas.areas.undecided_share
    return spent, (
        f"{AREAS}: {count} x {count}, {areas.evaluations} problems solved; {proved:.1%} of the area proved by "
        f"{len(areas.areas.proved)} solutions, {undecided:.1%} undecided"
    )


def agreement(timed: Mapping[str, Timed], same: Mapping[str, Any]) -> list[str]:
    """Say how many verdicts of each way are those of the certified sweep.

    Args:
        timed: all ways.
        same: those that must agree everywhere.

    Raises:
        DisagreementError: one of them does not.
    """
    notes = []
    wanted = timed["certified"].verdicts
    for name, found in timed.items():
        equal = sum(a is b for a, b in zip(found.verdicts, wanted, strict=True))
        unknown = sum(verdict is Verdict.UNKNOWN for verdict in found.verdicts)
        text = f"{NAME}: {name}: {found.verdicts.count(Verdict.FEASIBLE)} feasible, {unknown} undecided"
        notes.append(f"{text}, the verdict of the certified sweep at {equal} of {len(wanted)}")
        if name in same and equal != len(wanted):
            raise DisagreementError(f"{notes[-1]}: not the same problem")
    return notes
