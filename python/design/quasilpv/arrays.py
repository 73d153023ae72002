"""Arrays of numbers: their types, and what is done with them everywhere."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
"""Of doubles, of any shape; docstrings state the shape."""

Vector: TypeAlias = FloatArray
Matrix: TypeAlias = FloatArray
"""The same with one axis, and with two."""

IndexArray: TypeAlias = npt.NDArray[np.intp]
"""Of places in other arrays."""


def symmetric(matrix: npt.NDArray[np.floating[Any]]) -> FloatArray:
    """The symmetric part of a square matrix, ``(X + X') / 2``."""
    return np.asarray((matrix + matrix.T) / 2.0, dtype=np.float64)


def distinct(values: IndexArray) -> IndexArray:
    """The values without repetition, ascending.

    Sorted: the hash table of `numpy.unique` takes many times longer on millions of them (numpy 2.3 and later), and
    places mostly come in order.
    """
    ordered = np.sort(values, axis=None, kind="stable")
    return ordered[np.concatenate([[True], ordered[1:] != ordered[:-1]])] if ordered.size else ordered
