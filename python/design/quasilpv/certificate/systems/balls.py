"""Matrices of balls: their parts, bounds of their norms and eigenvalues, and matrices affine in the premises."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from flint import arb, arb_mat

from quasilpv.arrays import FloatArray
from quasilpv.documents.system_artifact import AffineDocument

_SPARE = 1e-9
"""Added to guesses in doubles, of the largest entry: less than that is rounding."""


def norm(matrix: arb_mat) -> float:
    """A number that no singular value of any matrix in the balls exceeds, proved by ``s^2 I - M' M > 0``.

    Raises:
        ArithmeticError: the balls are too wide for any number to be found.
    """
    middle, radius = split(matrix)
    guess = (float(np.linalg.norm(middle, 2)) + float(np.linalg.norm(radius))) * (1.0 + _SPARE) + 1e-150
    square = matrix.transpose() * matrix if matrix.ncols() <= matrix.nrows() else matrix * matrix.transpose()
    for _ in range(60):
        if is_below(square, guess * guess):
            return guess
        guess *= 1.02
    raise ArithmeticError("no bound of a norm was found: the cells are too wide")


def largest_eigenvalue(matrix: arb_mat) -> float:
    """A number that no eigenvalue of any symmetric matrix in the balls reaches, proved by ``s I - M > 0``.

    Raises:
        ArithmeticError: as for `norm`.
    """
    middle, radius = split(matrix)
    guess = float(np.linalg.eigvalsh(0.5 * (middle + middle.T))[-1] + np.linalg.norm(radius))
    step = _SPARE * float(np.abs(middle).max() + radius.max()) + 1e-300
    for _ in range(60):
        guess += step
        if is_below(matrix, guess):
            return guess
        step *= 2.0
    raise ArithmeticError("no bound of an eigenvalue was found: the cells are too wide")


def is_below(matrix: arb_mat, bound: float) -> bool:
    """Whether ``M < bound I`` for every symmetric matrix in the balls, as far as they can tell: Cholesky's pivots."""
    size = matrix.nrows()
    work = [[arb(bound) * int(i == j) - matrix[i, j] for j in range(size)] for i in range(size)]
    for k in range(size):
        pivot = work[k][k]
        if not pivot > 0:
            return False
        for i in range(k + 1, size):
            for j in range(i, size):
                work[i][j] = work[i][j] - work[k][i] * work[k][j] / pivot
    return True


def split(matrix: arb_mat) -> tuple[FloatArray, FloatArray]:
    """Middles and radii, in doubles.

    Raises:
        ArithmeticError: an entry is not finite.
    """
    shape = matrix.nrows(), matrix.ncols()
    entries = [entry for row in matrix.table() for entry in row]
    middle = np.array([float(entry.mid()) for entry in entries]).reshape(shape)
    radius = np.array([float(entry.rad()) for entry in entries]).reshape(shape)
    if not (np.isfinite(middle).all() and np.isfinite(radius).all()):
        raise ArithmeticError("a matrix could not be enclosed: the cells are too wide")
    return middle, radius


def constant(values: FloatArray) -> arb_mat:
    """Doubles, exactly."""
    rows, columns = values.shape
    return arb_mat(rows, columns, [arb(float(value)) for value in values.ravel()])


def exact(matrix: object) -> arb_mat:
    """Rationals, enclosed."""
    rows = matrix.table()  # type: ignore[attr-defined]
    return arb_mat(len(rows), len(rows[0]), [arb(entry) for row in rows for entry in row])


def at(affine: AffineDocument, z: Sequence[arb]) -> arb_mat:
    """``X(z)``."""
    total = constant(np.array(affine.constant))
    for value, slope in zip(z, affine.coefficients, strict=True):
        total = total + constant(np.array(slope)) * value
    return total


def part(matrix: arb_mat, top: int, bottom: int, left: int, right: int) -> arb_mat:
    """Rows ``top`` to ``bottom``, columns ``left`` to ``right``, the last ones left out."""
    table = matrix.table()
    return arb_mat(bottom - top, right - left, [table[i][j] for i in range(top, bottom) for j in range(left, right)])


def beside(matrices: Sequence[arb_mat]) -> arb_mat:
    """Side by side."""
    tables = [matrix.table() for matrix in matrices]
    rows = [[entry for table in tables for entry in table[i]] for i in range(len(tables[0]))]
    return arb_mat(len(rows), len(rows[0]), [entry for row in rows for entry in row])
