"""Direct assembly of a semidefinite program for Clarabel.

Each inequality ``F0 + sum_k x_k F_k > 0`` becomes ``-F x + s = svec(F0)``, ``s`` in the cone of positive semidefinite
matrices stored as the upper triangle, column by column, off-diagonal entries times sqrt(2) (Clarabel's
`PSDTriangleConeT`). The sparse columns come straight from the non-zero products of the terms ``L X R``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import clarabel
import numpy as np
import numpy.typing as npt
from scipy import sparse

from quasilpv.lmi.expressions import Expression, Triplets, Variable

if TYPE_CHECKING:
    from quasilpv.lmi.problem import Constraint


@dataclass(frozen=True)
class RawSolution:
    """What the solver returned; a candidate point at best."""

    values: Mapping[Variable, npt.NDArray[np.float64]] = field(default_factory=dict)
    infeasible: bool = False
    iterations: int = 0
    status: str = ""


def solve(
    constraints: Sequence[Constraint], objective: Expression | None, variables: Sequence[Variable]
) -> RawSolution:
    """Minimise the objective subject to every expression being positive semidefinite.

    Args:
        constraints: the inequalities.
        objective: 1 x 1 expression, or None for feasibility.
        variables: all variables, in the order of the unknown vector.
    """
    offsets = _offsets(variables)
    unknowns = sum(v.size for v in variables)
    rows, right_hand_side, cones = [], [], []
    for constraint in constraints:
        coefficients, value = _svec_rows(constraint.expression, offsets, unknowns)
        rows.append(-coefficients)
        right_hand_side.append(value)
        cones.append(clarabel.PSDTriangleConeT(constraint.expression.shape[0]))
    linear = np.zeros(unknowns)
    if objective is not None:
        _, _, unknown, value = _derivative(objective, offsets)
        np.add.at(linear, unknown, value)
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix((unknowns, unknowns)),
        linear,
        sparse.vstack(rows, format="csc"),
        np.concatenate(right_hand_side),
        cones,
        _settings(),
    )
    return _read(solver.solve(), variables, offsets)


def _settings() -> clarabel.DefaultSettings:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    return settings


def _read(result: clarabel.DefaultSolution, variables: Sequence[Variable], offsets: dict[Variable, int]) -> RawSolution:
    status = str(result.status)
    infeasible = "PrimalInfeasible" in status
    point = np.asarray(result.x)
    if infeasible or not np.all(np.isfinite(point)):
        return RawSolution(infeasible=infeasible, iterations=result.iterations, status=status)
    values = {v: v.unpack(point[offsets[v] : offsets[v] + v.size]) for v in variables}
    return RawSolution(values, iterations=result.iterations, status=status)


def _offsets(variables: Sequence[Variable]) -> dict[Variable, int]:
    starts = np.concatenate([[0], np.cumsum([v.size for v in variables])])
    return {v: int(start) for v, start in zip(variables, starts, strict=False)}


def _derivative(expression: Expression, offsets: dict[Variable, int]) -> Triplets:
    """``d expression / d unknowns`` as (row, column, unknown, value); entries may repeat and add up."""
    parts = []
    for term in expression.terms:
        row, column, unknown, value = term.derivative()
        parts.append((row, column, unknown + offsets[term.variable], value))
    if not parts:
        empty = np.zeros(0, dtype=np.intp)
        return empty, empty, empty, np.zeros(0)
    row, column, unknown, value = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return row, column, unknown, value


def _svec_rows(
    expression: Expression, offsets: dict[Variable, int], unknowns: int
) -> tuple[sparse.csc_matrix, npt.NDArray[np.float64]]:
    """Coefficients and constant of the scaled upper triangle of the symmetric part of an expression."""
    size = expression.shape[0]
    row, column, unknown, value = _derivative(expression, offsets)
    low, high = np.minimum(row, column), np.maximum(row, column)
    # An off-diagonal entry of svec is sqrt(2) times the mean of the two mirrored entries.
    weight = np.where(row == column, 1.0, np.sqrt(0.5))
    position = high * (high + 1) // 2 + low
    shape = (size * (size + 1) // 2, unknowns)
    coefficients = sparse.csc_matrix((value * weight, (position, unknown)), shape=shape)
    constant = expression.constant.astype(float)
    upper = np.triu_indices(size)
    order = np.lexsort((upper[0], upper[1]))
    i, j = upper[0][order], upper[1][order]
    return coefficients, np.where(i == j, constant[i, j], np.sqrt(0.5) * (constant[i, j] + constant[j, i]))
