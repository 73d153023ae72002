"""Direct assembly of a semidefinite program for Clarabel.

Each inequality ``F0 + sum_k x_k F_k > 0`` becomes ``-F x + s = svec(F0)``, ``s`` in the cone of positive semidefinite
matrices stored as the upper triangle, column by column, off-diagonal entries times sqrt(2) (Clarabel's
`PSDTriangleConeT`). The sparse columns come straight from the non-zero products of the terms ``L X R``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import sparse

from quasilpv.lmi import budget, worker
from quasilpv.lmi.assembly import gradient, unpack, upper_triangle
from quasilpv.lmi.constraint import Constraint
from quasilpv.lmi.expressions import Expression, Variable
from quasilpv.lmi.raw_solution import RawSolution


def solve(
    constraints: Sequence[Constraint], objective: Expression | None, variables: Sequence[Variable]
) -> RawSolution:
    """Minimise the objective subject to every expression being positive semidefinite.

    Args:
        constraints: the inequalities.
        objective: 1 x 1 expression, or None for feasibility.
        variables: all variables, in the order of the unknown vector.
    """
    rows, constants = [], []
    for constraint in constraints:
        budget.time_left_s()
        coefficients, value = upper_triangle(constraint.expression, variables, math.sqrt(0.5))
        rows.append(coefficients)
        constants.append(value)
    found = worker.solve(
        sparse.vstack(rows, format="csc"),
        np.concatenate(constants),
        [constraint.expression.shape[0] for constraint in constraints],
        objective=gradient(objective, variables),
        method="auto",
    )
    if found.infeasible or not np.all(np.isfinite(found.x)):
        return RawSolution(infeasible=found.infeasible, iterations=found.iterations, status=found.status)
    return RawSolution(unpack(found.x, variables), iterations=found.iterations, status=found.status)
