"""Exact rational arithmetic on small symmetric matrices: the last word on whether an inequality holds."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Matrix: TypeAlias = npt.NDArray[Any]


def to_rational(matrix: Any) -> Matrix:
    """Matrix of `fractions.Fraction`, each the exact value of its double (or integer, or rational) entry."""
    array = np.asarray(matrix, dtype=object)
    return np.vectorize(lambda x: x if isinstance(x, Fraction) else Fraction(x), otypes=[object])(array)  # type: ignore[no-any-return]


def is_positive_definite(matrix: Matrix) -> bool:
    """Whether a symmetric rational matrix is positive definite, decided without rounding.

    Gaussian elimination without pivoting: ``M > 0`` if and only if all pivots of ``L D L'`` are positive.

    Args:
        matrix: square array of `fractions.Fraction` or int, symmetric.

    Raises:
        ValueError: the matrix is not square or not symmetric.
    """
    work = to_rational(matrix)
    size = work.shape[0]
    if work.shape != (size, size) or any(work[i, j] != work[j, i] for i in range(size) for j in range(i)):
        raise ValueError(f"expected a symmetric matrix, got shape {work.shape}")
    for k in range(size):
        pivot = work[k, k]
        if pivot <= 0:
            return False
        for i in range(k + 1, size):
            factor = work[i, k] / pivot
            if factor:
                work[i, k + 1 :] = work[i, k + 1 :] - factor * work[k, k + 1 :]
    return True
