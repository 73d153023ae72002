"""Where the coefficients of compiled inequalities belong."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import FloatArray, IndexArray
from quasilpv.lmi.expressions import Variable

ExactArray = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Layout:
    """Which entry of which inequality a row is, and which unknown a coefficient multiplies.

    Rows number the upper triangles of all inequalities, one after the other, column by column.

    Attributes:
        names: of the inequalities.
        sizes: order of every inequality.
        variables: whose unknowns, one after the other, form x.
        row, unknown: place of every coefficient, (nnz,), row by row; unknown -1 is the constant term.
        kept: unknowns that are free; the others are zero without loss, because their columns depend on the kept ones.
    """

    names: tuple[str, ...]
    sizes: tuple[int, ...]
    variables: tuple[Variable, ...]
    row: IndexArray
    unknown: IndexArray
    kept: IndexArray

    @cached_property
    def rows(self) -> int:
        """Number of rows of all upper triangles."""
        return sum(size * (size + 1) // 2 for size in self.sizes)

    @cached_property
    def unknowns(self) -> int:
        """Number of scalar unknowns."""
        return sum(variable.size for variable in self.variables)

    @cached_property
    def diagonal(self) -> npt.NDArray[np.bool_]:
        """Whether a row is a diagonal entry, (rows,)."""
        flags = np.zeros(self.rows, dtype=bool)
        start = 0
        for size in self.sizes:
            flags[start + np.cumsum(np.arange(1, size + 1)) - 1] = True
            start += size * (size + 1) // 2
        return flags

    @cached_property
    def scale(self) -> FloatArray:
        """From a coefficient to its part in ``svec``, (nnz,): 1 on the diagonal, sqrt(1/2) of twice what is off it."""
        return np.where(self.diagonal, 1.0, np.sqrt(0.5))[self.row]

    @cached_property
    def columns(self) -> tuple[IndexArray, IndexArray, IndexArray]:
        """Kept columns, one after the other: which coefficients, in which row, and where each column starts."""
        column = np.full(self.unknowns + 1, -1)
        column[self.kept] = np.arange(len(self.kept))
        column = column[self.unknown]
        order = np.argsort(column, kind="stable")
        order = order[np.searchsorted(column[order], 0) :]
        return order, self.row[order], np.searchsorted(column[order], np.arange(len(self.kept) + 1))

    def sums(self, products: ExactArray) -> ExactArray:
        """Sum over every row of one number per coefficient, (nnz,) -> (rows,)."""
        rows, first, _ = self._starts
        total = np.zeros(self.rows, dtype=products.dtype)
        total[rows] = np.add.reduceat(products, first)
        return total

    @cached_property
    def _starts(self) -> tuple[IndexArray, IndexArray, IndexArray]:
        """The rows that have coefficients, the first one of each, and how many."""
        return np.unique(self.row, return_index=True, return_counts=True)

    @cached_property
    def longest_row(self) -> int:
        """Number of coefficients of the row that has the most."""
        return int(self._starts[2].max(initial=0))
