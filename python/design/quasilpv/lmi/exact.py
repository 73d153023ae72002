"""Exact rational arithmetic on small symmetric matrices: the last word on whether an inequality holds."""

from __future__ import annotations

from fractions import Fraction
from math import lcm
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Matrix: TypeAlias = npt.NDArray[Any]


def to_rational(matrix: Any) -> Matrix:
    """Array of `fractions.Fraction`: the exact value of every double, integer or rational entry, in the same shape."""
    array = np.asarray(matrix, dtype=object)
    exact: Matrix = np.array([Fraction(entry) for entry in array.flat], dtype=object).reshape(array.shape)
    return exact


def over_common_denominator(entries: Any) -> tuple[Matrix, int]:
    """Exact numbers as integers over one denominator: ``entries = integers / denominator``.

    Args:
        entries: flat array of doubles, integers or rationals.

    Returns:
        An array of Python integers, and the denominator > 0.
    """
    ratios = [entry.as_integer_ratio() for entry in np.asarray(entries).tolist()]
    common = lcm(1, *{denominator for _, denominator in ratios})
    integers = [numerator * (common // denominator) for numerator, denominator in ratios]
    return np.array(integers, dtype=object), common


def symmetric_part(matrix: Matrix) -> Matrix:
    """``(X + X') / 2``, exact for a rational matrix."""
    symmetric: Matrix = (matrix + matrix.T) * Fraction(1, 2)
    return symmetric


def is_positive_definite(matrix: Matrix) -> bool:
    """Whether a symmetric rational matrix is positive definite, decided without rounding.

    The leading minors of an integer multiple of ``S M S`` are all positive (Sylvester), S a diagonal of powers of two
    that brings the diagonal near one and keeps the integers short.

    Args:
        matrix: square array of `fractions.Fraction` or int, symmetric.

    Raises:
        ValueError: the matrix is not square or not symmetric.
    """
    work = to_rational(matrix)
    size = work.shape[0]
    if work.shape != (size, size) or any(work[i, j] != work[j, i] for i in range(size) for j in range(i)):
        raise ValueError(f"expected a symmetric matrix, got shape {work.shape}")
    if any(work[k, k] <= 0 for k in range(size)):
        return False
    return is_positive_triangle(_integer_rows(work))


def is_positive_triangle(rows: list[list[int]]) -> bool:
    """Whether a symmetric integer matrix is positive definite, decided without rounding.

    The minors of long integers are expensive, so that short ones are tried first. With S a diagonal of powers of two
    that brings the diagonal of ``S M S`` near ``2^SHORT_BITS``, its entries are cut to whole numbers. What is cut off
    is a matrix of n x n entries below 1, of norm below n: ``cut(S M S) - n I > 0`` proves M > 0, and M > 0 implies
    ``cut(S M S) + n I > 0``.

    Args:
        rows: of the upper triangle, the diagonal entry first.
    """
    if any(row[0] <= 0 for row in rows):
        return False
    scale = [row[0].bit_length() // 2 for row in rows]
    cut = [
        [_shifted(entry, SHORT_BITS - scale[i] - scale[i + k]) for k, entry in enumerate(row)]
        for i, row in enumerate(rows)
    ]
    if has_positive_minors([[row[0] - len(rows), *row[1:]] for row in cut]):
        return True
    if not has_positive_minors([[row[0] + len(rows), *row[1:]] for row in cut]):
        return False
    return has_positive_minors([list(row) for row in rows])


SHORT_BITS = 64
"""Length of the integers of the short proof; it decides nothing about matrices singular to about as many bits."""


def _shifted(entry: int, bits: int) -> int:
    """``entry * 2^bits`` rounded down."""
    return entry << bits if bits >= 0 else entry >> -bits


def has_positive_minors(rows: list[list[int]]) -> bool:
    """Whether all leading minors of a symmetric integer matrix are positive, that is, whether it is positive definite.

    Fraction-free elimination (Bareiss 1968): ``m_ij <- (d_k m_ij - m_ik m_kj) / d_{k-1}`` divides without remainder,
    and its pivots are the minors ``d_1, d_2, ...``.

    Args:
        rows: of the upper triangle, the diagonal entry first; used as scratch memory.
    """
    previous = 1
    for k, row in enumerate(rows):
        pivot = row[0]
        if pivot <= 0:
            return False
        for i, below in enumerate(rows[k + 1 :], start=1):
            factor = row[i]
            below[:] = [(pivot * m - factor * r) // previous for m, r in zip(below, row[i:], strict=True)]
        previous = pivot
    return True


def rank_factors(matrix: Matrix) -> tuple[Matrix, Matrix]:
    """``X = U V`` with U (rows, k) and V (k, columns) of full rank k, exact.

    Args:
        matrix: array of `fractions.Fraction` or int.
    """
    reduced, pivots = _row_echelon(matrix)
    return to_rational(matrix)[:, pivots], reduced[: len(pivots)]


def null_space(matrix: Matrix) -> Matrix:
    """Basis N of the vectors with ``X N = 0`` as columns, (columns, columns - k), exact.

    Args:
        matrix: array of `fractions.Fraction` or int, of rank k.
    """
    reduced, pivots = _row_echelon(matrix)
    free = [column for column in range(matrix.shape[1]) if column not in pivots]
    basis = to_rational(np.zeros((matrix.shape[1], len(free)), dtype=int))
    basis[free, range(len(free))] = Fraction(1)
    basis[pivots, :] = -reduced[: len(pivots), free]
    return basis


def _row_echelon(matrix: Matrix) -> tuple[Matrix, list[int]]:
    """Reduced row echelon form, and the columns of its leading ones."""
    rows = to_rational(matrix)
    pivots: list[int] = []
    for column in range(rows.shape[1]):
        rank = len(pivots)
        candidates = np.flatnonzero(rows[rank:, column])
        if not candidates.size:
            continue
        pivot = rank + int(candidates[0])
        rows[[rank, pivot]] = rows[[pivot, rank]]
        rows[rank] = rows[rank] / rows[rank, column]
        for other in np.flatnonzero(rows[:, column]):
            if other != rank:
                rows[other] = rows[other] - rows[other, column] * rows[rank]
        pivots.append(column)
    return rows, pivots


def _integer_rows(matrix: Matrix) -> list[list[int]]:
    """Upper triangle, row by row, of an integer multiple of ``S M S``; S makes every diagonal entry about one."""
    size = matrix.shape[0]
    scale = [Fraction(2) ** (-(_binary_exponent(matrix[k, k]) // 2)) for k in range(size)]
    rows = [[matrix[i, j] * scale[i] * scale[j] for j in range(i, size)] for i in range(size)]
    common = lcm(*(entry.denominator for row in rows for entry in row))
    return [[entry.numerator * (common // entry.denominator) for entry in row] for row in rows]


def _binary_exponent(value: Fraction) -> int:
    """About log2 of a positive rational of any size."""
    return value.numerator.bit_length() - value.denominator.bit_length()
