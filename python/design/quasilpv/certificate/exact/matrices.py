"""The few lines of exact block algebra the checker stands on: rational matrices and their definiteness.

Kept apart from the design's own vocabulary on purpose, so that one sign error cannot certify itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from flint import fmpq, fmpq_mat


def rational(value: Any) -> fmpq:
    """Exact rational value of a double, an integer or a fraction."""
    fraction = Fraction(value)
    return fmpq(fraction.numerator, fraction.denominator)


def matrix(rows: Sequence[Sequence[Any]]) -> fmpq_mat:
    """Exact matrix from rows of doubles, integers, fractions or rationals."""
    entries = [x if isinstance(x, fmpq) else rational(x) for row in rows for x in row]
    return fmpq_mat(len(rows), len(rows[0]), entries)


def identity(size: int) -> fmpq_mat:
    """Identity matrix."""
    return matrix([[int(i == j) for j in range(size)] for i in range(size)])


def zero(rows: int, columns: int) -> fmpq_mat:
    """Zero matrix."""
    return fmpq_mat(rows, columns)


def diagonal(entries: Sequence[fmpq]) -> fmpq_mat:
    """Diagonal matrix."""
    size = len(entries)
    return fmpq_mat(size, size, [x if i == j else fmpq(0) for i, x in enumerate(entries) for j in range(size)])


def stack(blocks: Sequence[Sequence[fmpq_mat]]) -> fmpq_mat:
    """Block matrix.

    Raises:
        ValueError: blocks of one row (column) differ in height (width).
    """
    rows: list[list[fmpq]] = []
    for line in blocks:
        tables = [block.table() for block in line]
        if any(len(table) != len(tables[0]) for table in tables):
            raise ValueError("blocks of one row differ in height")
        rows.extend([entry for table in tables for entry in table[i]] for i in range(len(tables[0])))
    if any(len(row) != len(rows[0]) for row in rows):
        raise ValueError("block rows differ in width")
    return matrix(rows)


def symmetric(upper: Sequence[Sequence[fmpq_mat | None]]) -> fmpq_mat:
    """Symmetric block matrix from its upper triangle; entries below the diagonal are given as None."""
    size = len(upper)
    full: list[list[fmpq_mat]] = []
    for i in range(size):
        line = []
        for j in range(size):
            block = upper[i][j] if j >= i else upper[j][i]
            if block is None:
                raise ValueError(f"block ({i}, {j}) is missing")
            line.append(block if j >= i else block.transpose())
        full.append(line)
    return stack(full)


def magnitude(square: fmpq_mat) -> fmpq_mat:
    """Absolute values, entry by entry."""
    return fmpq_mat(square.nrows(), square.ncols(), [abs(entry) for entry in square.entries()])


def trace(square: fmpq_mat) -> fmpq:
    """Sum of the diagonal."""
    return sum((square[i, i] for i in range(square.nrows())), fmpq(0))


def is_symmetric(square: fmpq_mat) -> bool:
    """Whether a matrix equals its transpose, exactly."""
    return bool(square == square.transpose())


def scaled_to_unit_diagonal(square: fmpq_mat) -> fmpq_mat:
    """``S M S`` with S a diagonal of powers of two that brings every positive diagonal entry into (1/2, 4).

    A congruence, so it changes no sign of an eigenvalue; it takes units out of the numbers and keeps them short.
    """
    size = square.nrows()
    scale = fmpq_mat(size, size)
    for k in range(size):
        entry = square[k, k]
        exponent = int(entry.p).bit_length() - int(entry.q).bit_length() if entry > 0 else 0
        scale[k, k] = rational(Fraction(2) ** -(exponent // 2))
    return scale * square * scale


def is_positive_definite(square: fmpq_mat) -> bool:
    """Whether a symmetric matrix is positive definite: all its leading principal minors are positive (Sylvester).

    The minors of an integer multiple, by fraction-free elimination (Bareiss 1968):
    ``m_ij <- (d_k m_ij - m_ik m_kj) / d_(k-1)`` leaves no remainder, and its pivots d_k are the leading minors.
    A matrix that is not symmetric is not positive definite here.
    """
    if not is_symmetric(square):
        return False
    numerators, _ = scaled_to_unit_diagonal(square).numer_denom()
    work = [[int(entry) for entry in row] for row in numerators.table()]
    size = len(work)
    previous = 1
    for k in range(size):
        pivot = work[k][k]
        if pivot <= 0:
            return False
        for i in range(k + 1, size):
            for j in range(i, size):
                work[i][j] = (pivot * work[i][j] - work[k][i] * work[k][j]) // previous
        previous = pivot
    return True
