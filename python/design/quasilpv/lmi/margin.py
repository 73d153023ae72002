"""The margin program: how far a problem is from the edge between feasible and infeasible.

A feasibility problem that fails tells nothing: the solver may have met the end of its patience or of its accuracy. The
margin program of the inequalities ``M_k(x) = F_k0 + sum_i x_i F_ki > 0`` always has an answer. With the homogenised
matrices ``M_k(s, x) = s F_k0 + sum_i x_i F_ki`` and ``mu`` the mean of all their eigenvalues,

    maximise t - eps mu   subject to   s >= 1,   P >= I for every inequality that is P > 0 for an unknown P alone,
                                       M_k >= t I for the others,   t <= 1.

It has points for every problem: t is free to be negative. A strictly feasible point, scaled up, reaches t = 1, and
``x / s`` is such a point whenever t > 0. If t < 0 there is none. What fixes the scale is not relaxed: with P > 0
relaxed as well, an unstable system with one stable direction would have margin zero (P singular), not a negative one.
The small weight eps picks the smallest of all points, so that the set of solutions is bounded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from quasilpv.lmi import backends
from quasilpv.lmi.backends import BackendName
from quasilpv.lmi.constraint import Constraint
from quasilpv.lmi.exact import Matrix
from quasilpv.lmi.expressions import Expression, Product, ScalarProduct, Term, Variable, constant, identity, zeros
from quasilpv.lmi.problem import Outcome, Problem

UNDECIDED = 1e-5
"""Smaller margins are within reach of the solver's accuracy: neither verdict is given. Also the weight eps."""

TIGHT = 1e-3
"""An inequality is tight if the smallest eigenvalue of its matrix exceeds its bound by less than this."""


@dataclass(frozen=True, eq=False)
class Margin:
    """Answer of the margin program.

    Attributes:
        outcome: `Outcome.VERIFIED` (the point satisfies the problem, in exact arithmetic), `Outcome.SOLVER_ONLY`
            (positive margin, but the exact check fails), `Outcome.INFEASIBLE_NUMERICALLY`, or `Outcome.UNKNOWN`.
        margin: ``t / mu``, at most 1, if t is positive, else t. It passes continuously through zero as the data change.
            NaN without an answer.
        tight: names of the inequalities that determine the margin; of an infeasible problem, those that disagree.
        values: the point, one matrix per variable; empty unless the margin is positive.
    """

    outcome: Outcome
    margin: float
    tight: tuple[str, ...] = ()
    values: Mapping[Variable, npt.NDArray[np.float64]] = field(default_factory=dict)


def largest_margin(problem: Problem, *, backend: BackendName = "clarabel", solver: str | None = None) -> Margin:
    """Solve the margin program of a problem; its objective plays no part.

    The margin depends on the units of the unknowns and inequalities, its sign does not: write problems in units in
    which the unknowns are of order one (`scaling_report` says whether they are). A problem without constants needs an
    inequality P > 0 for an unknown: otherwise all unknowns zero are as good as anything, and the margin is zero.

    Args:
        problem: at least one inequality.
        backend, solver: what solves it, see `backends.solve`.

    Raises:
        ValueError: there is no such back end or solver.
    """
    t, s = Variable("t", 1), Variable("s", 1)
    matrices = [*(_homogenised(c.expression, s) for c in problem.constraints), s.expression]
    rows = sum(M.shape[0] for M in matrices)
    mean = sum((_trace(M) for M in matrices), zeros(1, 1)) * (1.0 / rows)
    level = [identity(1) if _is_unknown(M) else t.expression for M in matrices]
    program = [
        Constraint(str(k), M - floor * identity(M.shape[0]).constant)
        for k, (M, floor) in enumerate(zip(matrices, level, strict=True))
    ]
    program.append(Constraint("largest", identity(1) - t))
    raw = backends.solve(program, mean * UNDECIDED - t, (*problem.variables, s, t), backend, solver)
    if not raw.values:
        return Margin(Outcome.UNKNOWN, math.nan)
    reached = float(raw.values[t][0, 0])
    margin = reached / float(mean.at(raw.values)[0, 0]) if reached > 0.0 else reached
    tight = tuple(
        c.name
        for c, bounded in zip(problem.constraints, program, strict=False)
        if _smallest_eigenvalue(bounded.expression.at(raw.values)) < TIGHT
    )
    if abs(margin) < UNDECIDED:
        return Margin(Outcome.UNKNOWN, margin, tight)
    if margin < 0.0:
        return Margin(Outcome.INFEASIBLE_NUMERICALLY, margin, tight)
    values = {v: raw.values[v] / raw.values[s][0, 0] for v in problem.variables}
    outcome = Outcome.VERIFIED if problem.holds_exactly(values) else Outcome.SOLVER_ONLY
    return Margin(outcome, margin, tight, values)


def _is_unknown(M: Expression) -> bool:
    """Whether a homogenised matrix is nothing but one symmetric unknown."""
    if len(M.terms) != 1 or np.any(M.constant != 0) or not isinstance(M.terms[0], Product):
        return False
    product, size = M.terms[0], M.shape[0]
    return product.variable.rows == size and all(
        np.array_equal(factor, identity(size).constant) for factor in (product.left, product.right)
    )


def _smallest_eigenvalue(matrix: Matrix) -> float:
    values = matrix.astype(float)
    return float(np.linalg.eigvalsh((values + values.T) / 2.0)[0])


def _homogenised(expression: Expression, scale: Variable) -> Expression:
    linear = Expression(zeros(*expression.shape).constant, expression.terms)
    return linear + scale * expression.constant if np.any(expression.constant != 0) else linear


def _trace(expression: Expression) -> Expression:
    """Trace as a 1 x 1 expression: with ``trace = sum_ij C_ij X_ij`` for every variable, one product per row of C."""
    weights: dict[Variable, Matrix] = {}
    for term in expression.terms:
        weights[term.variable] = weights.get(term.variable, 0) + _trace_weights(term)
    total = constant([[np.trace(expression.constant)]])
    for variable, weight in weights.items():
        unit = identity(variable.rows).constant
        for i, row in enumerate(weight):
            if np.any(row != 0):
                total = total + unit[[i]] @ variable @ row[:, None]
    return total


def _trace_weights(term: Term) -> Matrix:
    """C with ``trace term = sum_ij C_ij X_ij``: trace (L X R) = trace (R L X)."""
    if isinstance(term, ScalarProduct):
        return np.array([[np.trace(term.coefficient)]])
    product: Matrix = term.right @ term.left
    return product if term.transposed else product.T
