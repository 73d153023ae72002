"""Is a set of homogeneous linear matrix inequalities feasible? The answer of a solver, and what it is worth.

Inequalities ``F_k(x) > 0`` without constant terms hold at x if and only if they hold at every positive multiple of x,
so nothing is lost by asking a solver for ``F_k(x) >= I``: a solution leaves room for an exact proof, and x = 0 is none.
A candidate counts only after that proof. Infeasibility is numerical: the solver's dual certificate Z with ``Z_k >= 0``,
``sum_k <F_k(x), Z_k> = <r, x>`` shows that no x of norm below ``sum_k tr Z_k / |r|`` satisfies ``F_k(x) >= I``.
That norm is no evidence: it is as large where a solver fails for its units alone as where there is no solution. Whether
other units change the answer is for `quasilpv.studies.examination` to find out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from quasilpv.arrays import FloatArray
from quasilpv.lmi import worker
from quasilpv.lmi.assembly import triangle_places
from quasilpv.lmi.compiled import CompiledProblem, rounded
from quasilpv.lmi.expressions import Variable
from quasilpv.lmi.problem import Outcome


@dataclass(frozen=True, eq=False)
class Decision:
    """What is known about a set of inequalities.

    Attributes:
        outcome: `Outcome.VERIFIED` (proved, exact arithmetic), `Outcome.SOLVER_ONLY`, `Outcome.INFEASIBLE_NUMERICALLY`
            or `Outcome.UNKNOWN`.
        values: the proved point, one matrix per variable; empty otherwise.
        point: the same as the kept unknowns of the compiled problem, which proves it again
            (`CompiledProblem.holds_exactly`); empty otherwise.
        margin: at that point, the smallest eigenvalue of all inequalities over the mean of all their eigenvalues, in
            double: at most the largest margin there is (`quasilpv.lmi.margin`). NaN otherwise.
        excluded_norm: of a numerically infeasible problem: no x of smaller Euclidean norm satisfies ``F_k(x) >= I``,
            as far as the certificate was computed correctly. NaN otherwise.
        solver_status: in the solver's words.
        iterations: of the solver.
    """

    outcome: Outcome
    values: Mapping[Variable, FloatArray] = field(default_factory=dict)
    point: FloatArray = field(default_factory=lambda: np.empty(0))
    margin: float = float("nan")
    excluded_norm: float = float("nan")
    solver_status: str = ""
    iterations: int = 0

    @property
    def feasible(self) -> bool:
        """Whether feasibility was proved."""
        return self.outcome is Outcome.VERIFIED


def decide(problem: CompiledProblem) -> Decision:
    """Decide homogeneous inequalities.

    Args:
        problem: without constant terms.

    Raises:
        ValueError: an inequality has a constant term.
        TimeUpError: the time limit was reached (`quasilpv.lmi.budget`).
        TooLargeError: the solver ran into the memory limit.
    """
    coefficients, offset = problem.matrix()
    if offset.any():
        raise ValueError("decide: the inequalities have constant terms, expected homogeneous ones")
    solution = worker.solve(coefficients, -problem.layout.diagonal.astype(float), problem.layout.sizes)
    status, point = solution.status, solution.x
    if np.all(np.isfinite(point)) and "Infeasible" not in status:
        candidate = rounded(point)
        if problem.holds_exactly(candidate):
            margin = _margin(problem, coefficients @ candidate)
            return Decision(
                Outcome.VERIFIED,
                problem.values(candidate),
                candidate,
                margin,
                solver_status=status,
                iterations=solution.iterations,
            )
        if status == "Solved":
            return Decision(Outcome.SOLVER_ONLY, solver_status=status, iterations=solution.iterations)
    if solution.infeasible:
        excluded = _excluded_norm(problem, coefficients, solution.z)
        return Decision(
            Outcome.INFEASIBLE_NUMERICALLY,
            excluded_norm=excluded,
            solver_status=status,
            iterations=solution.iterations,
        )
    return Decision(Outcome.UNKNOWN, solver_status=status, iterations=solution.iterations)


def _margin(problem: CompiledProblem, entries: FloatArray) -> float:
    """Smallest over mean eigenvalue; entries are the scaled upper triangles. Blocks of one order go together."""
    layout = problem.layout
    sizes = np.array(layout.sizes)
    starts = np.concatenate([[0], np.cumsum(sizes * (sizes + 1) // 2)[:-1]])
    smallest = np.inf
    for size in np.unique(sizes).tolist():
        i, j = triangle_places(size)
        triangles = entries[starts[sizes == size][:, None] + np.arange(len(i))]
        matrices = np.zeros((len(triangles), size, size))
        matrices[:, j, i] = triangles * np.where(i == j, 1.0, np.sqrt(0.5))
        smallest = min(smallest, float(np.linalg.eigvalsh(matrices)[:, 0].min()))
    return smallest / (float(entries @ layout.diagonal) / int(sizes.sum()))


def _excluded_norm(problem: CompiledProblem, coefficients: sparse.csc_matrix, dual: FloatArray) -> float:
    residual = float(np.linalg.norm(coefficients.T @ dual))
    traces = float(dual @ problem.layout.diagonal)
    return traces / residual if residual > 0.0 else np.inf
