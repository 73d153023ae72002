"""Direct assembly of a semidefinite program for Clarabel.

Each inequality ``F0 + sum_k x_k F_k > 0`` becomes ``-F x + s = svec(F0)``, ``s`` in the cone of positive semidefinite
matrices stored as the upper triangle, column by column, off-diagonal entries times sqrt(2) (Clarabel's
`PSDTriangleConeT`). The sparse columns come straight from the non-zero products of the terms ``L X R``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import clarabel
import numpy as np
from scipy import sparse

from quasilpv.lmi import budget
from quasilpv.lmi.assembly import gradient, unpack, upper_triangle
from quasilpv.lmi.expressions import Expression, Variable
from quasilpv.lmi.raw_solution import RawSolution

if TYPE_CHECKING:
    from quasilpv.lmi.problem import Constraint


def solve(
    constraints: Sequence[Constraint], objective: Expression | None, variables: Sequence[Variable]
) -> RawSolution:
    """Minimise the objective subject to every expression being positive semidefinite.

    Args:
        constraints: the inequalities.
        objective: 1 x 1 expression, or None for feasibility.
        variables: all variables, in the order of the unknown vector.
    """
    rows, right_hand_side, cones = [], [], []
    for constraint in constraints:
        coefficients, value = upper_triangle(constraint.expression, variables, math.sqrt(0.5))
        rows.append(-coefficients)
        right_hand_side.append(value)
        cones.append(clarabel.PSDTriangleConeT(constraint.expression.shape[0]))
    linear = gradient(objective, variables)
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix((linear.size, linear.size)),
        linear,
        sparse.vstack(rows, format="csc"),
        np.concatenate(right_hand_side),
        cones,
        _settings(),
    )
    return _read(solver.solve(), variables)


def _settings() -> clarabel.DefaultSettings:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    left = budget.time_left_s()
    if left is not None:
        settings.time_limit = left
    return settings


def _read(result: clarabel.DefaultSolution, variables: Sequence[Variable]) -> RawSolution:
    status = str(result.status)
    infeasible = "PrimalInfeasible" in status
    point = np.asarray(result.x)
    if infeasible or not np.all(np.isfinite(point)):
        return RawSolution(infeasible=infeasible, iterations=result.iterations, status=status)
    return RawSolution(unpack(point, variables), iterations=result.iterations, status=status)
