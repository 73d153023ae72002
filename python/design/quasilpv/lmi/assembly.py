"""From expressions to the numbers of a solver: one vector of unknowns, and sparse upper triangles linear in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from scipy import sparse

from quasilpv.arrays import FloatArray
from quasilpv.lmi.expressions import Expression, Triplets, Variable


def unknown_offsets(variables: Sequence[Variable]) -> dict[Variable, int]:
    """Where the unknowns of each variable start in the vector of all unknowns, in the order given."""
    starts = np.concatenate([[0], np.cumsum([v.size for v in variables])])
    return {v: int(start) for v, start in zip(variables, starts, strict=False)}


def unpack(point: FloatArray, variables: Sequence[Variable]) -> dict[Variable, FloatArray]:
    """One matrix per variable from the vector of all unknowns."""
    return {v: v.unpack(point[start : start + v.size]) for v, start in unknown_offsets(variables).items()}


def gradient(objective: Expression | None, variables: Sequence[Variable]) -> FloatArray:
    """Derivative of a 1 x 1 expression by the unknowns; zero without an objective."""
    linear = np.zeros(sum(v.size for v in variables))
    if objective is not None:
        _, _, unknown, value = _derivative(objective, unknown_offsets(variables))
        np.add.at(linear, unknown, value)
    return linear


def upper_triangle(
    expression: Expression, variables: Sequence[Variable], mirrored_weight: float = 0.5
) -> tuple[sparse.csc_matrix, FloatArray]:
    """Coefficients and constant of the upper triangle of an expression, as double.

    Entry (i, j), i <= j, is row ``j (j + 1) / 2 + i``: column by column.

    Args:
        expression: n x n; only its symmetric part counts.
        variables: of the vector of unknowns.
        mirrored_weight: factor of ``e_ij + e_ji``, i < j: 1/2 gives the entries of the symmetric part, sqrt(1/2) its
            scaled vector (``svec``, which preserves inner products).

    Returns:
        Matrix of ``n (n + 1) / 2`` rows and one column per unknown, and the vector of constants.
    """
    size = expression.shape[0]
    row, column, unknown, value = _derivative(expression, unknown_offsets(variables))
    low, high = np.minimum(row, column), np.maximum(row, column)
    weight = np.where(row == column, 1.0, mirrored_weight)
    shape = (size * (size + 1) // 2, sum(v.size for v in variables))
    coefficients = sparse.csc_matrix((value * weight, (high * (high + 1) // 2 + low, unknown)), shape=shape)
    constant = expression.constant.astype(float)
    i, j = triangle_places(size)
    return coefficients, np.where(i == j, constant[i, j], mirrored_weight * (constant[i, j] + constant[j, i]))


def triangle_places(size: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Row and column of every entry of an upper triangle, column by column."""
    i, j = np.triu_indices(size)
    order = np.lexsort((i, j))
    return i[order], j[order]


def _derivative(expression: Expression, offsets: Mapping[Variable, int]) -> Triplets:
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
