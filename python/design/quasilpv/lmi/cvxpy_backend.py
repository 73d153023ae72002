"""The same semidefinite program written in cvxpy, for any of its solvers: a slow, readable oracle.

Nothing of the direct assembly is used: every term is multiplied out by cvxpy itself.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import cvxpy as cp
import numpy as np

from quasilpv.lmi.constraint import Constraint
from quasilpv.lmi.expressions import Expression, ScalarProduct, Term, Variable
from quasilpv.lmi.raw_solution import RawSolution

DEFAULT_SOLVER = "CLARABEL"
INSTALLED_SOLVERS: tuple[str, ...] = tuple(cp.installed_solvers())  # type: ignore[no-untyped-call]

# Where a solver's own defaults are of no use here: SCS stops at 1e-4, and the Cholesky step of CVXOPT gives up near the
# solutions of ill-conditioned problems.
_OPTIONS: Mapping[str, Mapping[str, Any]] = {
    "SCS": {"eps": 1e-8, "max_iters": 50_000},
    "CVXOPT": {"kktsolver": "ldl"},
}


def solve(
    constraints: Sequence[Constraint],
    objective: Expression | None,
    variables: Sequence[Variable],
    solver: str = DEFAULT_SOLVER,
) -> RawSolution:
    """Minimise the objective subject to every expression being positive semidefinite.

    Args:
        constraints: the inequalities.
        objective: 1 x 1 expression, or None for feasibility.
        variables: all variables.
        solver: a semidefinite solver that cvxpy finds installed, by the name cvxpy gives it.

    Raises:
        ValueError: the solver is not installed.
    """
    name = solver.upper()
    if name not in INSTALLED_SOLVERS:
        raise ValueError(f"solver: got {solver!r}, expected one of {', '.join(INSTALLED_SOLVERS)}")
    unknowns = {v: cp.Variable((v.rows, v.cols), symmetric=v.symmetric and v.rows > 1) for v in variables}
    matrices = [_matrix(constraint.expression, unknowns) for constraint in constraints]
    cost = 0.0 if objective is None else _matrix(objective, unknowns)[0, 0]
    program: Any = cp.Problem(cp.Minimize(cost), [(matrix + matrix.T) / 2 >> 0 for matrix in matrices])
    try:
        with warnings.catch_warnings():  # an inaccurate solution is a candidate like any other
            warnings.simplefilter("ignore")
            program.solve(solver=name, **_OPTIONS.get(name, {}))
    except (cp.SolverError, ArithmeticError, ValueError) as error:
        return RawSolution(status=f"{type(error).__name__}: {error}")
    infeasible = program.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE)
    iterations = int(program.solver_stats.num_iters or 0)
    values = {v: unknown.value for v, unknown in unknowns.items()}
    if infeasible or any(value is None or not np.all(np.isfinite(value)) for value in values.values()):
        return RawSolution(infeasible=infeasible, iterations=iterations, status=program.status)
    return RawSolution(
        {v: np.asarray(value, dtype=float) for v, value in values.items()},
        iterations=iterations,
        status=program.status,
    )


def _matrix(expression: Expression, unknowns: Mapping[Variable, cp.Variable]) -> Any:
    total: Any = cp.Constant(expression.constant.astype(float))
    for term in expression.terms:
        total = total + _product(term, unknowns[term.variable])
    return total


def _product(term: Term, unknown: cp.Variable) -> Any:
    if isinstance(term, ScalarProduct):
        return term.coefficient.astype(float) * unknown[0, 0]
    middle = unknown.T if term.transposed else unknown
    return term.left.astype(float) @ middle @ term.right.astype(float)
